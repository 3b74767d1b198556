"""False walls: walls reported where nothing but drums stands, in halls driven once and in a hall driven for hours.

Drums of any size, posts among them, are all there is: the walls and the box of the random halls are left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.settings import Settings
from config.units import FOOT_M
from config.world import AcousticsConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import firing_pattern, sensors
from drivers.messages import Firing, Floats, Pose
from perception.detected_object import DetectedObject
from perception.pipeline import Perception
from runtime.cycle.step import CycleRecord, State
from runtime.simulation.closed_loop import simulate
from runtime.simulation.open_loop import perceive
from runtime.simulation.random_halls import ACOUSTICS, random_hall

LOOK_FIRINGS: Final = 20
"""A look is the report after every so many firings: one in a second."""
SURE: Final = 0.95
"""Least probability of a wall that is counted as sure."""
HOUR_S: Final = 3600.0
STEPS_M: Final = (0.05 * FOOT_M, 0.2 * FOOT_M, 0.5 * FOOT_M, FOOT_M)
"""Distances between two firings of one sensor; hall by hall in turn."""


@dataclass(slots=True)
class FalseWallTrial:
    """The looks of one drive, and those that held a wall.

    Attributes
    ----------
    looks : int
        All looks.
    with_wall, with_sure_wall : int
        Those with a wall of any probability, and of at least `SURE`.
    at_end : int
        Walls in the last look.
    """

    looks: int = 0
    with_wall: int = 0
    with_sure_wall: int = 0
    at_end: int = 0

    def add(self, seen: tuple[DetectedObject, ...]) -> None:
        """Count one look."""
        walls = [it.score for it in seen if it.model == "wall"]
        self.looks += 1
        self.with_wall += len(walls) > 0
        self.with_sure_wall += max(walls, default=0.0) >= SURE
        self.at_end = len(walls)


def drum_hall(seed: int, acoustics: AcousticsConfig = ACOUSTICS) -> tuple[WorldConfig, Floats]:
    """Return a random hall of round objects alone, and the path through it: x, y (m) and ring yaw (rad), (n, 3).

    Parameters
    ----------
    seed : int
        Which hall.
    acoustics : AcousticsConfig
        By default specular, with 1 % noise, 3 % outliers and 5 % drop-outs.
    """
    world, path = random_hall(seed, acoustics)
    return world.model_copy(update={"polygon": (), "box": ()}), np.array(path)


def try_hall(settings: Settings, seed: int, acoustics: AcousticsConfig, step_m: float) -> FalseWallTrial:
    """Drive through a hall of round objects and return the walls that were reported.

    Parameters
    ----------
    settings : Settings
        Ring, models and perception.
    seed : int
        Of the hall and of the noise.
    acoustics : AcousticsConfig
        Model of reflection and errors.
    step_m : float
        Distance between two firings of one sensor.
    """
    world, path = drum_hall(seed, acoustics)
    perception, ring = Perception(settings.ring, settings.models, settings.perception), settings.ring
    sonar = Sonar(ring, compile_scene(world), acoustics, np.random.default_rng([seed, 21]))
    pattern, trial = firing_pattern(ring), FalseWallTrial()
    driven = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path[:, :2], axis=0).T))])
    at = np.arange(0.0, driven[-1], step_m / len(pattern.masks))
    x, y = (np.interp(at, driven, path[:, k]) for k in (0, 1))
    yaw = float(path[0, 2])
    for k, place in enumerate(zip(x.tolist(), y.tolist(), strict=True)):
        pose = Pose(*place, yaw)
        ranges = sonar.fire(pose, yaw, sensors(pattern.masks[k % len(pattern.masks)]))
        perceive(perception, Firing(k * pattern.step_period_s, pose, yaw, ranges))
        if k % LOOK_FIRINGS == LOOK_FIRINGS - 1 or k == len(at) - 1:
            trial.add(perception.labelled_objects())
    return trial


def drive_hall(
    settings: Settings, world: WorldConfig, seed: int, hours: float, report: Callable[[float], None]
) -> FalseWallTrial:
    """Run the robot's whole process in a world for hours of virtual time and return the walls that were reported.

    Parameters
    ----------
    settings : Settings
        The robot and everything it does.
    world : WorldConfig
        Without walls.
    seed : int
        Of all randomness.
    hours : float
        Virtual time.
    report : callable
        Called with the hours that are over, at each look.
    """
    trial, every = FalseWallTrial(), round(settings.cycle.rate_hz)

    def look(record: CycleRecord, state: State, _start: Pose) -> None:
        if record.cycle % every == 0:
            trial.add(state.perception.labelled_objects())
            report(record.cycle / settings.cycle.rate_hz / HOUR_S)

    simulate(settings, world, seed, hours * HOUR_S, on_state=look)
    return trial
