"""Drives with good and with drifting odometry, on which correction of drift is compared with none.

A seed gives robot, room, acoustics, duration and drive: each shipped robot with an ordinary ring, the shipped worlds,
furnished rooms and rooms without a drum. The robot drives legs between random places and turns on the spot; its ring
turns with it, unless it is a synchro drive. Poses by odometry are rounded as in a ring log.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from bench.trials.drumless_rooms import drumless_room
from bench.trials.furnished_rooms import furnished_room
from config.load import load_settings, load_world
from config.settings import Settings
from config.world import AcousticsConfig, OdometryConfig, WorldConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import Scene, compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import firing_pattern, sensors
from drivers.messages import Firing, Pose, wrap_angle
from runtime.simulation.drift_trials import odometry_along

ROBOTS: Final = (
    "p3dx",
    "denning",
    "amigo",
    "b21r",
    "p3at",
    "b21r-base",
    "magellan",
    "atrvjr",
    "powerbot",
    "peoplebot",
)
ROOMS: Final = ("room", "furnished", "irregular", "boxes", "office", "furnished", "hallway", "clutter")
NOISES: Final = (0.0, 0.003, 0.005, 0.01)
DROPOUTS: Final = (0.0, 0.0, 0.02, 0.05)
OUTLIERS: Final = (0.0, 0.0, 0.01, 0.03)
SECONDS: Final = (60.0, 180.0)
SPEED_M_S: Final = 0.3
TURN_RAD_S: Final = 0.6
LEG_M: Final = (0.6, 4.0)
LEG_TRIES: Final = 400
CLEAR_M: Final = 0.12
"""Least distance from the robot's body to a surface on the way."""
DECIMALS: Final = 4
"""Of a pose in a ring log."""
AROUND_M: Final = 1.5
"""How far around the surfaces of an open world the robot drives."""


def level_name(errors: OdometryConfig) -> str:
    """Return a level's errors as a table names them."""
    return f"{errors.scale - 1.0:.0%}, {math.degrees(errors.heading_rad_per_sqrt_m):g}°/√m"


@dataclass(frozen=True, slots=True)
class CorrectionDrive:
    """One drive.

    Attributes
    ----------
    settings : Settings
        Robot and model.
    room : str
        One of `ROOMS`.
    world : WorldConfig
        The world, in its own coordinates.
    firings : list of Firing
        With poses by odometry, whose frame begins at the first pose.
    truth : list of Pose
        The ring's true poses, in the frame of the first pose; headings are unwrapped.
    start : Pose
        The first pose in the world's coordinates.
    """

    settings: Settings
    room: str
    world: WorldConfig
    firings: list[Firing]
    truth: list[Pose]
    start: Pose

    def drums(self) -> list[tuple[float, float]]:
        """Return the places of the drums in the frame of the first pose, m."""
        to = self.start.inverse()
        seen = [to.compose(Pose(drum.x_m, drum.y_m, 0.0)) for drum in self.world.drum]
        return [(at.x, at.y) for at in seen]


def room_of(seed: int) -> str:
    """Return which of the `ROOMS` is that of a seed."""
    return ROOMS[(seed + seed // len(ROBOTS)) % len(ROOMS)]


def correction_drive(seed: int, odometry: OdometryConfig, seconds: float | None = None) -> CorrectionDrive:
    """Return a drive.

    Parameters
    ----------
    seed : int
        Of everything.
    odometry : OdometryConfig
        Errors of the odometry: its scale and the walk of its heading.
    seconds : float, optional
        Its duration; by default one in `SECONDS`.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 38]))
    settings = load_settings(None, robot=ROBOTS[seed % len(ROBOTS)], models=["drum"])
    room = room_of(seed)
    acoustics = AcousticsConfig(
        model=("cone", "specular")[int(rng.integers(2))],
        noise_relative=float(rng.choice(NOISES)),
        dropout=float(rng.choice(DROPOUTS)),
        outliers=float(rng.choice(OUTLIERS)),
    )
    duration = float(rng.uniform(*SECONDS))
    world = _world(room, seed, acoustics)
    ring, radius_m = settings.ring, settings.body.radius_m
    path = _path(rng, world, radius_m + CLEAR_M, ring.firing.step_period_s, seconds or duration)
    sonar = Sonar(ring, compile_scene(world), acoustics, np.random.default_rng(np.random.SeedSequence([seed, 39])))
    pattern, synchro = firing_pattern(ring), settings.body.synchro
    to = path[0].inverse()
    truth = [Pose(there.x, there.y, at.theta - path[0].theta) for at, there in ((at, to.compose(at)) for at in path)]
    firings = []
    reported = odometry_along(truth, odometry, np.random.default_rng(np.random.SeedSequence([seed, 40])))
    for k, (at, pose) in enumerate(zip(path, reported, strict=True)):
        ranges = sonar.fire(
            at, path[0].theta if synchro else at.theta, sensors(pattern.masks[k % len(pattern.masks)])
        )
        rounded = Pose(*(round(number, DECIMALS) for number in (pose.x, pose.y, pose.theta)))
        firings.append(Firing(k * ring.firing.step_period_s, rounded, 0.0 if synchro else rounded.theta, ranges))
    return CorrectionDrive(settings, room, world, firings, truth, path[0])


def _world(room: str, seed: int, acoustics: AcousticsConfig) -> WorldConfig:
    """Return the world of one of the `ROOMS`."""
    if room == "furnished":
        return furnished_room(seed, acoustics).world
    if room in {"boxes", "clutter"}:
        return drumless_room(seed, acoustics, is_cluttered=room == "clutter").world
    return load_world(room).model_copy(update={"acoustics": acoustics})


def _path(
    rng: np.random.Generator, world: WorldConfig, clear_m: float, period_s: float, seconds: float
) -> list[Pose]:  # fmt: skip
    """Return the poses at the firings, with unwrapped headings: legs, and turns on the spot."""
    scene = compile_scene(world)
    low, high = _extent(world)
    firings = round(seconds / period_s)
    for _ in range(LEG_TRIES):
        x, y = rng.uniform(low, high).tolist()
        here = Pose(x, y, float(rng.uniform(-math.pi, math.pi)))
        rows = [here]
        while len(rows) < firings:
            leg = _leg(rng, scene, rows[-1], low, high, clear_m)
            if leg is None:
                break
            rows += _steps(rows[-1], leg, period_s)
        if len(rows) >= firings:
            return rows[:firings]
    raise ValueError(f"no way of {seconds:g} s for a robot that needs {clear_m:g} m")


def _extent(world: WorldConfig) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the greatest coordinates of where the robot drives, m."""
    points = [(drum.x_m, drum.y_m) for drum in world.drum] + [(box.x_m, box.y_m) for box in world.box]
    points += [(wall.x1_m, wall.y1_m) for wall in world.wall] + [(wall.x2_m, wall.y2_m) for wall in world.wall]
    points += [vertex for polygon in world.polygon for vertex in polygon.vertices_m]
    around = 0.0 if world.wall or world.polygon else AROUND_M
    return np.min(points, axis=0) - around, np.max(points, axis=0) + around


def _leg(
    rng: np.random.Generator, scene: Scene, here: Pose, low: np.ndarray, high: np.ndarray, clear_m: float
) -> tuple[float, float] | None:  # fmt: skip
    """Return a place to which a straight way from here is clear."""
    for _ in range(LEG_TRIES):
        x, y = rng.uniform(low, high).tolist()
        length = math.dist((x, y), (here.x, here.y))
        if not LEG_M[0] < length < LEG_M[1]:
            continue
        parts = np.linspace(0.0, 1.0, 2 + round(length / (0.5 * CLEAR_M)))
        way = [(here.x + part * (x - here.x), here.y + part * (y - here.y)) for part in parts.tolist()]
        if all(clearance(*at, scene.circles, scene.segments) > clear_m for at in way):
            return x, y
    return None


def _steps(here: Pose, there: tuple[float, float], period_s: float) -> list[Pose]:
    """Return the poses after each firing of a turn on the spot and a straight way."""
    x, y = there
    turn = wrap_angle(math.atan2(y - here.y, x - here.x) - here.theta)
    turns, length = math.ceil(abs(turn) / (TURN_RAD_S * period_s)), math.dist((x, y), (here.x, here.y))
    steps = math.ceil(length / (SPEED_M_S * period_s))
    heading = here.theta + turn
    return [Pose(here.x, here.y, here.theta + turn * k / turns) for k in range(1, turns + 1)] + [
        Pose(here.x + (x - here.x) * k / steps, here.y + (y - here.y) * k / steps, heading)
        for k in range(1, steps + 1)
    ]
