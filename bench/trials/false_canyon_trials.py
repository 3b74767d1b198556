"""False canyons: dead ends reported where the robot could pass, among drums and in corridors with doorways.

Each seed gives one corridor. Its start is open; its rooms and its end have a second way out, so that it has no dead
end for a robot that passes its doorways.
"""

from __future__ import annotations

import itertools
import math
import time
from dataclasses import dataclass, field
from typing import Final, Literal, TypeAlias

import numpy as np

from config.settings import Settings
from config.world import AcousticsConfig, WallConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import firing_pattern, sensors
from drivers.messages import Firing, Floats, Pose
from perception.percept import Canyon
from perception.pipeline import Perception
from runtime.simulation.random_halls import ACOUSTICS

DOORWAY_M: Final = (1.1, 1.6)
"""Width of a doorway."""
WIDTH_M: Final = (1.4, 3.0)
LENGTH_M: Final = (9.0, 14.0)
JAMB_M: Final = 0.6
"""Least length of a wall between two doorways."""
ROOM_M: Final = (2.0, 4.0)
"""Depth of the rooms beside the corridor."""
POCKET_M: Final = 0.3
"""The corridor goes on at most this far behind a doorway at its end."""
BEND_M: Final = 4.0
"""Length of the corridor behind its bend."""
BEFORE_END_M: Final = 0.9
SWAY_M: Final = 0.1
SPEED_M_S: Final = 0.5

End: TypeAlias = Literal["open", "doorway", "side doorway", "bend"]
ENDS: Final[tuple[End, ...]] = ("open", "doorway", "side doorway", "bend")
"""What the end of a corridor is, by seed in turn."""


@dataclass(slots=True)
class FalseCanyonTrial:
    """What one drive reported.

    Attributes
    ----------
    driven_m : float
        Length of the drive.
    reported : dict of int to Canyon
        Each canyon when it was surest, by number.
    at_end : int
        Canyons in the last report.
    quanta_s : list of float
        Thread time of each place that was examined, s.
    """

    driven_m: float = 0.0
    reported: dict[int, Canyon] = field(default_factory=dict)
    at_end: int = 0
    quanta_s: list[float] = field(default_factory=list)

    def add(self, canyons: tuple[Canyon, ...]) -> None:
        """Take the report after a firing."""
        for canyon in canyons:
            before = self.reported.get(canyon.number)
            if before is None or canyon.probability > before.probability:
                self.reported[canyon.number] = canyon
        self.at_end = len(canyons)

    def above(self, probability: float) -> int:
        """Return how many canyons were at some time at least so probable."""
        return sum(one.probability >= probability for one in self.reported.values())


def corridor(seed: int, acoustics: AcousticsConfig = ACOUSTICS) -> tuple[WorldConfig, Floats]:
    """Return a corridor with doorways, and the path through it and back: x, y (m) and ring yaw (rad), shape (n, 3).

    Parameters
    ----------
    seed : int
        Which corridor.
    acoustics : AcousticsConfig
        By default specular, with 1 % noise, 3 % outliers and 5 % drop-outs.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 37]))
    end: End = ENDS[seed % len(ENDS)]
    width, length = float(rng.uniform(*WIDTH_M)), float(rng.uniform(*LENGTH_M))
    half, exit_side = 0.5 * width, int(rng.choice([-1, 1]))
    walls: list[tuple[float, float, float, float]] = []
    for side in (1, -1):
        stop = length
        if end == "bend" and side == exit_side:
            stop = length - width
        elif end == "side doorway" and side == exit_side:
            far = length - float(rng.uniform(0.0, POCKET_M))
            stop = far - float(rng.uniform(*DOORWAY_M))
            walls.append((far, side * half, length, side * half))
        doorways = _doorways(rng, stop)
        edges = [0.0, *(edge for doorway in doorways for edge in doorway), stop]
        walls += [(a, side * half, b, side * half) for a, b in zip(edges[::2], edges[1::2], strict=True)]
        walls += _rooms(rng, doorways, stop, side * half, side)
    if end == "bend":
        far = exit_side * (half + BEND_M)
        walls += [(length, -exit_side * half, length, far), (length - width, exit_side * half, length - width, far)]
    elif end != "open":
        gap = min(float(rng.uniform(*DOORWAY_M)), width) if end == "doorway" else 0.0
        low = float(rng.uniform(-half, half - gap))
        walls += [(length, -half, length, low), (length, low + gap, length, half)]
    walls = [wall for wall in walls if math.dist(wall[:2], wall[2:]) > 0.0]
    pieces = tuple(WallConfig(x1_m=a, y1_m=b, x2_m=c, y2_m=d) for a, b, c, d in walls)
    wave, phase, yaw = float(rng.uniform(3.0, 6.0)), float(rng.uniform(0.0, math.tau)), float(rng.uniform(-3.1, 3.1))
    there = np.arange(0.3, length - BEFORE_END_M, 0.05)
    x = np.concatenate([there, there[::-1]])
    y = SWAY_M * np.sin(math.tau * np.arange(len(x)) * 0.05 / wave + phase)
    return WorldConfig(wall=pieces, acoustics=acoustics), np.column_stack([x, y, np.full(len(x), yaw)])


def _doorways(rng: np.random.Generator, stop: float) -> list[tuple[float, float]]:
    """Return the doorways in a wall from 0 to `stop`, in turn."""
    doorways, at = [], float(rng.uniform(JAMB_M, 3.0))
    while (close := at + float(rng.uniform(*DOORWAY_M))) < stop - JAMB_M:
        doorways.append((at, close))
        at = close + float(rng.uniform(JAMB_M, 4.0))
    return doorways


def _rooms(
    rng: np.random.Generator, doorways: list[tuple[float, float]], stop: float, y: float, side: int
) -> list[tuple[float, float, float, float]]:
    """Return the walls of rooms behind the doorways, each of which has a second doorway in its outer wall."""
    far = y + side * float(rng.uniform(*ROOM_M))
    borders = [0.0, *(0.5 * (a[1] + b[0]) for a, b in itertools.pairwise(doorways)), stop] if doorways else []
    walls = [(x, y, x, far) for x in borders]
    for a, b in itertools.pairwise(borders):
        gap = min(float(rng.uniform(*DOORWAY_M)), b - a)
        low = float(rng.uniform(a, b - gap))
        walls += [(a, far, low, far), (low + gap, far, b, far)]
    return walls


def try_path(
    settings: Settings, world: WorldConfig, path: Floats, seed: int, step_m: float | None = None
) -> FalseCanyonTrial:
    """Drive along a path, looking for canyons as on the way to a goal, and return those that were reported.

    Parameters
    ----------
    settings : Settings
        Ring, models and perception.
    world : WorldConfig
        Without a dead end for this robot.
    path : (n, 3) float
        Places (m) and ring yaw (rad).
    seed : int
        Of the noise.
    step_m : float, optional
        Distance between two firings of one sensor; by default that of a robot at `SPEED_M_S`.
    """
    perception, ring = Perception(settings.ring, settings.models, settings.perception), settings.ring
    perception.canyon_map.is_wanted = True
    sonar = Sonar(ring, compile_scene(world), world.acoustics, np.random.default_rng([seed, 41]))
    pattern, trial = firing_pattern(ring), FalseCanyonTrial()
    apart = SPEED_M_S * pattern.step_period_s if step_m is None else step_m / len(pattern.masks)
    driven = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path[:, :2], axis=0).T))])
    at = np.arange(0.0, driven[-1], apart)
    x, y = (np.interp(at, driven, path[:, k]) for k in (0, 1))
    yaw = float(path[0, 2])
    for k, place in enumerate(zip(x.tolist(), y.tolist(), strict=True)):
        pose = Pose(*place, yaw)
        ranges = sonar.fire(pose, yaw, sensors(pattern.masks[k % len(pattern.masks)]))
        _perceive(perception, Firing(k * pattern.step_period_s, pose, yaw, ranges), trial.quanta_s)
        trial.add(perception.canyons())
    trial.driven_m = float(driven[-1])
    return trial


def _perceive(perception: Perception, firing: Firing, quanta_s: list[float]) -> None:
    """Process a firing, refine until convergence, and append what the canyon's quanta took."""
    perception.observe(firing)
    while perception.can_refine:
        is_place = perception.canyon_map.is_due and not perception.method.can_refine
        began_s = time.thread_time()
        if not perception.refine():
            return
        if is_place:
            quanta_s.append(time.thread_time() - began_s)
