"""Rounds among drums with drifting odometry: what is recognised, and where the robot believes to be, with the truth.

The path is the same for every seed, whatever the odometry says, so that the errors can be compared. It is driven in
virtual time. An octet of the ring fires at each step, as on the Denning. Lengths are in feet, as for other scenes.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import mean
from typing import Final, TypedDict

import numpy as np

from config.settings import LocalizationConfig, Settings
from config.units import FOOT_M
from config.world import DrumConfig, OdometryConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Firing, Pose, wrap_angle
from perception.localization.map_frame import MapFrame
from perception.pipeline import Perception
from runtime.simulation.evaluation import nearest_pairs, place_nees
from runtime.simulation.open_loop import perceive
from runtime.simulation.random_halls import ACOUSTICS
from runtime.simulation.scenes import OCTET, SPEED_M_S

PLACES_FT: Final = (
    (-4.0, 5.4),
    (1.0, 5.5),
    (6.0, 5.4),
    (-5.0, -5.4),
    (0.0, -5.5),
    (5.5, -5.4),
    (-1.5, 0.0),
    (3.5, 0.0),
)
"""Of the drums: six around the path, two within."""
MOVES_FT: Final = (0.5, 0.3)
"""Largest random offsets of a drum."""
RADIUS_FT: Final = 1.0
ROUNDS: Final = 3
STRAIGHT_FT: Final = 10.0
TURN_RADIUS_FT: Final = 2.6
MIDDLE_FT: Final = 1.0
"""The path: two straights and two half circles, about this place on the x axis."""
STEP_FT: Final = 0.08
LEVELS: Final = (
    OdometryConfig(),
    OdometryConfig(scale=1.01, heading_rad_per_sqrt_m=math.radians(0.3)),
    OdometryConfig(scale=1.02, heading_rad_per_sqrt_m=math.radians(1.0)),
    OdometryConfig(scale=1.03, heading_rad_per_sqrt_m=math.radians(2.0)),
)
"""Errors of the odometry, the first of which is none."""


@dataclass(frozen=True, slots=True)
class DriftOutcome:
    """The end of one drive; lengths in metres, angles in rad."""

    errors: tuple[float, ...]
    """Errors of the drums found, as seen from the robot."""
    missed: int
    false: int
    """Drums not found; objects that are no drums."""
    place: float
    heading: float
    """Errors of the robot's pose in the map frame."""
    nees: float | None = None
    """Normalised squared error of that pose, three degrees of freedom; None without correction, as what follows."""
    object_nees: float | None = None
    """The same of the objects' places in the map frame, two degrees of freedom, the mean over them."""
    odometer_error: float | None = None
    range_error: float | None = None
    """Relative errors of the scales found."""


class DriftRow(TypedDict):
    """The mean over the drives of one level of errors; lengths in metres."""

    scale: float
    heading_deg_per_sqrt_m: float
    corrected: bool
    seeds: int
    drums: int
    missed: int
    false: int
    mean_error: float | None
    place: float
    heading_deg: float
    nees: float | None
    object_nees: float | None
    odometer_error: float | None
    """Root mean square, as the next one."""
    range_error: float | None


def drum_hall(seed: int) -> WorldConfig:
    """Return the hall; the seed determines the places of the drums and the scale of the ranges, within 1 %."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 6]))
    moves = rng.uniform(-1.0, 1.0, (len(PLACES_FT), 2)) * MOVES_FT
    drums = tuple(
        DrumConfig(x_m=(x + dx) * FOOT_M, y_m=(y + dy) * FOOT_M, radius_m=RADIUS_FT * FOOT_M)
        for (x, y), (dx, dy) in zip(PLACES_FT, moves.tolist(), strict=True)
    )
    sound = {"sound_speed_scale": 1.0 + float(rng.uniform(-0.01, 0.01))}
    return WorldConfig(drum=drums, acoustics=ACOUSTICS.model_copy(update=sound))


def oval(rounds: int = ROUNDS) -> list[Pose]:
    """Return the true poses at the firings: x, y (m) and the direction of travel (rad), unwrapped."""
    straight, radius, middle = STRAIGHT_FT * FOOT_M, TURN_RADIUS_FT * FOOT_M, MIDDLE_FT * FOOT_M
    half = straight + math.pi * radius
    steps = round(2 * rounds * half / (STEP_FT * FOOT_M))
    poses = []
    for k in range(steps + 1):
        side, way = divmod(2 * rounds * half * k / steps, half)
        turn = max(0.0, way - straight) / radius
        x = min(way, straight) - 0.5 * straight + radius * math.sin(turn)
        heading = math.pi * side
        c, s = math.cos(heading), math.sin(heading)
        y = -radius * math.cos(turn)
        poses.append(Pose(middle + c * x - s * y, s * x + c * y, heading + turn))
    return poses


def odometry_along(path: Sequence[Pose], errors: OdometryConfig, rng: np.random.Generator) -> Iterator[Pose]:
    """Yield the poses that odometry reports along a path; at its start it is right.

    The true headings are unwrapped; `rng` is the source of the random walk of the reported ones.
    """
    yield path[0]
    reported = path[0]
    for before, after in itertools.pairwise(path):
        step = before.inverse().compose(after)
        way = math.hypot(step.x, step.y)
        wander = errors.heading_rad_per_sqrt_m * math.sqrt(way) * float(rng.standard_normal())
        c, s = errors.scale * math.cos(0.5 * wander), errors.scale * math.sin(0.5 * wander)
        reported = reported.compose(Pose(c * step.x - s * step.y, s * step.x + c * step.y, step.theta + wander))
        yield reported


def firings(
    settings: Settings, world: WorldConfig, path: Sequence[Pose], errors: OdometryConfig, seed: int, *, synchro: bool
) -> Iterator[Firing]:
    """Yield the firings along a path, with the poses that odometry reports.

    Parameters
    ----------
    settings : Settings
        The ring.
    world : WorldConfig
        The hall.
    path : sequence of Pose
        The true poses.
    errors : OdometryConfig
        Of the odometry.
    seed : int
        Of the noise of ranges and odometry.
    synchro : bool
        Whether the ring keeps its direction, which odometry then knows exactly, while the wheels turn.
    """
    sonar = Sonar(
        settings.ring, compile_scene(world), world.acoustics, np.random.default_rng(np.random.SeedSequence([seed, 1]))
    )
    reported = odometry_along(path, errors, np.random.default_rng(np.random.SeedSequence([seed, 7])))
    sensors = len(settings.ring.mounts)
    for k, (true, pose) in enumerate(zip(path, reported, strict=True)):
        true_yaw, yaw = (path[0].theta, path[0].theta) if synchro else (true.theta, pose.theta)
        ranges = sonar.fire(true, true_yaw, range(k % OCTET, sensors, OCTET))
        yield Firing(k * STEP_FT * FOOT_M / SPEED_M_S, pose, yaw, ranges)


def drive(
    settings: Settings, errors: OdometryConfig, seed: int, *, corrected: bool, synchro: bool = False
) -> DriftOutcome:
    """Drive the rounds once and return how its end compares with the truth.

    `corrected`: whether recognised drums correct the drift; `synchro`: as for `firings`.
    """
    world, path = drum_hall(seed), oval()
    config = settings.perception.model_copy(update={"localization": LocalizationConfig(correct_drift=corrected)})
    perception = Perception(settings.ring, settings.models, config)
    pose = path[0]
    for firing in firings(settings, world, path, errors, seed, synchro=synchro):
        perceive(perception, firing)
        pose = firing.pose
    localized = perception.localized()
    robot = pose if localized is None else localized.pose
    true = path[-1]
    names = {model.name for model in settings.models if model.arc_radius_m is not None}
    seen = [one for one in perception.mapped_objects() if one.model in names]
    drums = [(drum.x_m, drum.y_m) for drum in world.drum]
    views = [_from(robot, one.x, one.y) for one in seen]
    from_true = [_from(true, *drum) for drum in drums]
    pairs = nearest_pairs(from_true, views)
    outcome = DriftOutcome(
        tuple(math.dist(from_true[i], views[k]) for i, k in pairs.items()),
        len(drums) - len(pairs),
        len(seen) - len(pairs),
        math.dist((robot.x, robot.y), (true.x, true.y)),
        abs(wrap_angle(robot.theta - true.theta)),
    )
    if localized is None or not isinstance(perception.map_frame, MapFrame):
        return outcome
    off = np.array([robot.x - true.x, robot.y - true.y, wrap_angle(robot.theta - true.theta)])
    object_nees = [
        place_nees(seen[k].x - drums[i][0], seen[k].y - drums[i][1], covariance)
        for i, k in pairs.items()
        if (covariance := seen[k].covariance) is not None
    ]
    estimate = perception.map_frame.drift.e[0]
    return replace(
        outcome,
        nees=float(off @ np.linalg.solve(localized.covariance, off)),
        object_nees=mean(object_nees) if object_nees else None,
        odometer_error=estimate.odometer_scale / errors.scale - 1.0,
        range_error=estimate.range_scale * world.acoustics.sound_speed_scale - 1.0,
    )


def summarise_drives(errors: OdometryConfig, outcomes: Sequence[DriftOutcome]) -> DriftRow:
    """Return the row of the table for the drives of one level, all corrected or none; at least one drive."""
    of_drums = [error for outcome in outcomes for error in outcome.errors]
    return {
        "scale": errors.scale,
        "heading_deg_per_sqrt_m": math.degrees(errors.heading_rad_per_sqrt_m),
        "corrected": outcomes[0].nees is not None,
        "seeds": len(outcomes),
        "drums": sum(len(outcome.errors) + outcome.missed for outcome in outcomes),
        "missed": sum(outcome.missed for outcome in outcomes),
        "false": sum(outcome.false for outcome in outcomes),
        "mean_error": mean(of_drums) if of_drums else None,
        "place": mean(outcome.place for outcome in outcomes),
        "heading_deg": math.degrees(mean(outcome.heading for outcome in outcomes)),
        "nees": _mean_of([outcome.nees for outcome in outcomes]),
        "object_nees": _mean_of([outcome.object_nees for outcome in outcomes]),
        "odometer_error": _rms_of([outcome.odometer_error for outcome in outcomes]),
        "range_error": _rms_of([outcome.range_error for outcome in outcomes]),
    }


def _mean_of(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return mean(known) if known else None


def _rms_of(values: Sequence[float | None]) -> float | None:
    squares = _mean_of([None if value is None else value * value for value in values])
    return None if squares is None else math.sqrt(squares)


def _from(robot: Pose, x: float, y: float) -> tuple[float, float]:
    """Return a place as seen from a pose."""
    seen = robot.inverse().compose(Pose(x, y, 0.0))
    return seen.x, seen.y
