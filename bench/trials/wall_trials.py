"""The walls and corners that perception reports in random rooms, compared with the truth.

Truth is what answered: of each wall the points from which echoes were heard, and what lies between two of them that
are near each other. Reported length is right where it lies on a wall in its direction, and false elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final, TypeAlias

import numpy as np

from bench.trials.furnished_rooms import FurnishedRoom, drive
from config.robot import RingConfig
from config.settings import Settings
from config.units import FOOT_M
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import firing_pattern, sensors
from drivers.messages import Firing, Floats, Pose
from perception.detected_object import DetectedObject
from perception.pipeline import Perception
from runtime.simulation.open_loop import perceive

Spans: TypeAlias = list[tuple[float, float]]
"""Parts of a line from low to high in ascending order, m."""
BETWEEN_M: Final = 0.35
"""What lies between two points that answered counts if it is shorter than this."""
WALL_MIN_M: Final = 2.2 * FOOT_M
PLACE_M: Final = 0.05
PLACES_MIN: Final = 4
"""A wall counts if this length, and so many places of it, answered."""
RIGHT_M: Final = 0.05
RIGHT_RAD: Final = math.radians(3.0)
"""Reported length is right within this of a wall and of its direction."""
ON_WALL_M: Final = 1e-3
"""An echo comes from a wall if its point lies this near."""
CORNER_ECHOES_MIN: Final = 10
"""A corner or an edge counts if so many echoes came from the point itself."""
HEARD_SIGMAS: Final = 4.0
"""A range is an echo's if its error is less than this."""
CORNER_WITHIN_M: Final = 0.15
"""A reported one is right within this of a true one of its kind."""
DRIVE_M: Final = 25.0
DENSE_DRIVE_M: Final = 12.0
DENSE_STEP_M: Final = 0.15 * FOOT_M
"""Length of a drive; the shorter one if a sensor fires again within this step."""


@dataclass(frozen=True, slots=True)
class Segment:
    """A straight piece of wall, from end to end, m."""

    begin: Floats
    end: Floats

    @property
    def length_m(self) -> float:
        """Distance between the ends."""
        return float(np.hypot(*(self.end - self.begin)))

    @property
    def direction(self) -> Floats:
        """Unit vector from begin to end."""
        return np.asarray((self.end - self.begin) / self.length_m)

    def off_and_along(self, points: Floats) -> tuple[Floats, Floats]:
        """Return how far points (n, 2) lie left of the line, and how far along it from its beginning, m."""
        tx, ty = self.direction
        delta = points - self.begin
        return tx * delta[:, 1] - ty * delta[:, 0], delta @ self.direction

    def distance(self, points: Floats) -> Floats:
        """Return the distances of points (n, 2) from the segment, m."""
        off, along = self.off_and_along(points)
        return np.hypot(off, along - np.clip(along, 0.0, self.length_m))


@dataclass(frozen=True, slots=True)
class Corner:
    """A point where two walls meet, or where one ends: an edge."""

    x: float
    y: float
    is_edge: bool

    def distance(self, other: Corner) -> float:
        """Return the distance from another point of the same kind, m; +inf from one of the other kind."""
        return math.dist((self.x, self.y), (other.x, other.y)) if self.is_edge == other.is_edge else math.inf


@dataclass(frozen=True, slots=True)
class CornerTrial:
    """The corners and edges of one drive.

    Attributes
    ----------
    answered, found : int
        How many answered, and how many of these were found.
    errors_m : tuple of float
        Of all right ones, m.
    false : int
        How many false ones were reported.
    """

    answered: int
    found: int
    errors_m: tuple[float, ...]
    false: int


@dataclass(frozen=True, slots=True)
class WallTrial:
    """Lengths (m), counts and errors of one drive.

    Lines are those of the walls that count; errors are of all reported walls that lie on a true one.
    """

    walls: int
    answered_m: float
    found_m: float
    reported_m: float
    false_m: float
    lines: int
    offsets_m: tuple[float, ...]
    angles_rad: tuple[float, ...]
    corners: CornerTrial


def reported_corners(objects: Iterable[DetectedObject]) -> list[Corner]:
    """Return the corners and edges among reported objects."""
    kinds = {"edge": True, "inside corner": False}
    return [Corner(seen.x, seen.y, is_edge=kinds[seen.model]) for seen in objects if seen.model in kinds]


def true_corners(walls: Sequence[Segment]) -> list[Corner]:
    """Return the points where walls meet, and those where one ends alone."""
    ends = np.concatenate([[wall.begin, wall.end] for wall in walls])
    is_same = np.hypot(*(ends[:, None] - ends[None]).transpose(2, 0, 1)) < ON_WALL_M
    firsts = np.flatnonzero(is_same.argmax(axis=1) == np.arange(len(ends)))
    return [
        Corner(float(ends[k, 0]), float(ends[k, 1]), is_edge=bool(is_same[k].sum() == 1)) for k in firsts.tolist()
    ]


def compare_corners(true: Sequence[Corner], echoes: Sequence[int], found: Sequence[Corner]) -> CornerTrial:
    """Return how reported corners compare with the true ones.

    Parameters
    ----------
    true : sequence of Corner
        The true corners.
    echoes : sequence of int
        The echoes that came from each of them.
    found : sequence of Corner
        The reported ones.
    """
    errors = np.array([[a.distance(b) for b in found] for a in true]).reshape(len(true), len(found))
    is_right = errors < CORNER_WITHIN_M
    heard = np.asarray(echoes) >= CORNER_ECHOES_MIN
    nearest = errors.min(axis=1, initial=math.inf)
    return CornerTrial(
        int(heard.sum()), int((heard & is_right.any(axis=1)).sum()),
        tuple(nearest[nearest < CORNER_WITHIN_M].tolist()), int((~is_right.any(axis=0)).sum()),
    )  # fmt: skip


def reported_walls(objects: Iterable[DetectedObject]) -> list[Segment]:
    """Return the walls among reported objects."""
    ends = (seen.ends for seen in objects)
    return [Segment(np.array(end[:2]), np.array(end[2:])) for end in ends if end is not None]


@dataclass(frozen=True, slots=True)
class Heard:
    """What a drive through a room heard, and where from.

    Attributes
    ----------
    firings : tuple of Firing
        What perception is given.
    walls : tuple of Segment
        The true walls.
    answered : tuple of (n,) float
        Where each wall answered, from its beginning in ascending order, m.
    corners : tuple of Corner
        The true corners and edges.
    echoes : tuple of int
        The echoes that came from each of them.
    points : (n, 2) float
        Where all echoes truly came from, m.
    """

    firings: tuple[Firing, ...]
    walls: tuple[Segment, ...]
    answered: tuple[Floats, ...]
    corners: tuple[Corner, ...]
    echoes: tuple[int, ...]
    points: Floats = field(default_factory=lambda: np.empty((0, 2)))


def listen(
    ring: RingConfig, room: FurnishedRoom, seed: int, step_m: float, poses: Floats | None = None
) -> Heard:  # fmt: skip
    """Drive through a room and return what is heard.

    An echo that drops out, or in whose place a wrong range is reported, is not heard.

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    room : FurnishedRoom
        The room, with its acoustics.
    seed : int
        Of the drive and of the noise.
    step_m : float
        Distance between two firings of one sensor.
    poses : (n, 3) float, optional
        Where the ring fires, m and rad; by default along a drive of the seed.
    """
    acoustics, scene, pattern = room.world.acoustics, compile_scene(room.world), firing_pattern(ring)
    sonar = Sonar(ring, scene, acoustics, np.random.default_rng([seed, 9]))
    sets = [sensors(mask) for mask in pattern.masks]
    length_m = DENSE_DRIVE_M if step_m < DENSE_STEP_M else DRIVE_M
    relative, least_m = acoustics.noise_relative, HEARD_SIGMAS * acoustics.noise_m + ring.resolution_m
    firings, points = [], []
    poses = drive(room, seed, step_m / len(sets), length_m) if poses is None else poses
    for k, (x, y, yaw) in enumerate(poses.tolist()):
        pose = Pose(x, y, yaw)
        ranges, true = sonar.fire(pose, yaw, sets[k % len(sets)]), sonar.echoes
        is_heard = np.isfinite(ranges) & np.isclose(ranges, true["distance"], HEARD_SIGMAS * relative, least_m)
        points.append(np.column_stack([true["x"], true["y"]])[is_heard])
        firings.append(Firing(k * ring.firing.step_period_s, pose, yaw, ranges))
    walls = tuple(Segment(np.array([w.x1_m, w.y1_m]), np.array([w.x2_m, w.y2_m])) for w in room.world.wall)
    corners, heard = tuple(true_corners(walls)), np.concatenate(points)
    echoes = tuple(int((np.hypot(*(heard - (it.x, it.y)).T) < ON_WALL_M).sum()) for it in corners)
    answered = tuple(_answered(a, heard, b.bend_m) for a, b in zip(walls, room.world.wall, strict=True))
    return Heard(tuple(firings), walls, answered, corners, echoes, heard)


def _answered(wall: Segment, points: Floats, bend_m: float) -> Floats:
    """Return where a wall answers with echoes from these points, shape (n, 2), if it bends by this much."""
    off, along = wall.off_and_along(points)
    is_on = (np.abs(off) < abs(bend_m) + ON_WALL_M) & (along > -ON_WALL_M) & (along < wall.length_m + ON_WALL_M)
    return np.sort(along[is_on].clip(0.0, wall.length_m))


def recognise(settings: Settings, heard: Heard) -> Perception:
    """Return perception after a drive."""
    perception = Perception(settings.ring, settings.models, settings.perception)
    for firing in heard.firings:
        perceive(perception, firing)
    perception.surfaces.finish()
    return perception


def try_room(settings: Settings, room: FurnishedRoom, seed: int, step_m: float) -> WallTrial:
    """Drive through a room and return how the reported walls compare with those that answered.

    Parameters
    ----------
    settings : Settings
        Ring, models and perception.
    room, seed, step_m
        As for `listen`.
    """
    heard = listen(settings.ring, room, seed, step_m)
    seen = recognise(settings, heard).labelled_objects()
    corners = compare_corners(heard.corners, heard.echoes, reported_corners(seen))
    return compare(heard.walls, heard.answered, reported_walls(seen), corners)


def compare(
    walls: Sequence[Segment], answered: Sequence[Floats], found: Sequence[Segment], corners: CornerTrial
) -> WallTrial:  # fmt: skip
    """Return how reported walls compare with the true ones.

    Parameters
    ----------
    walls : sequence of Segment
        The true walls.
    answered : sequence of (n,) float
        Where each wall answered, from its beginning in ascending order, m.
    found : sequence of Segment
        The reported walls.
    corners : CornerTrial
        The comparison of the corners.
    """
    owners: list[int] = []
    offsets: list[float] = []
    angles: list[float] = []
    false_m = 0.0
    for line in found:
        middles = line.begin + ((np.arange(_pieces(line)) + 0.5) / _pieces(line))[:, None] * (line.end - line.begin)
        turns = np.array([abs(_sine(wall.direction, line.direction)) for wall in walls])
        distances = np.array([wall.distance(middles) for wall in walls])
        right = (distances < RIGHT_M) & (turns < math.sin(RIGHT_RAD))[:, None]
        false_m += line.length_m * float(1.0 - right.any(axis=0).mean())
        owner = int(right.sum(axis=1).argmax()) if right.any() else -1
        owners.append(owner)
        if owner >= 0:
            offsets.append(float(abs(walls[owner].off_and_along(0.5 * (line.begin + line.end)[None])[0][0])))
            angles.append(math.asin(min(1.0, float(turns[owner]))))
    count, lines, answered_m, found_m = 0, 0, 0.0, 0.0
    for k, (wall, at) in enumerate(zip(walls, answered, strict=True)):
        truth = spans_of(at)
        truth_m = sum(high - low for low, high in truth)
        if len(np.unique((at / PLACE_M).astype(np.int64))) < PLACES_MIN or truth_m < WALL_MIN_M:
            continue
        own = [line for line, owner in zip(found, owners, strict=True) if owner == k]
        ends = [np.sort(wall.off_and_along(np.array([line.begin, line.end]))[1]) for line in own]
        covered = joined([(float(low), float(high)) for low, high in ends])
        count += 1
        lines += len(own)
        answered_m += truth_m
        found_m += sum(max(0.0, min(b, d) - max(a, c)) for a, b in truth for c, d in covered)
    return WallTrial(
        count, answered_m, found_m, sum(line.length_m for line in found), false_m, lines, tuple(offsets),
        tuple(angles), corners,
    )  # fmt: skip


def _sine(a: Floats, b: Floats) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def _pieces(line: Segment) -> int:
    return max(2, int(line.length_m / PLACE_M))


def spans_of(at: Floats) -> Spans:
    """Return what lies between points that are near each other; the points are in ascending order, m."""
    parts = np.split(at, np.flatnonzero(np.diff(at) >= BETWEEN_M) + 1) if len(at) else []
    return [(float(part[0]), float(part[-1])) for part in parts]


def joined(parts: Spans) -> Spans:
    """Return spans without those parts of them that others cover."""
    whole: Spans = []
    for low, high in sorted(parts):
        last = whole[-1][1] if whole else -math.inf
        whole.append((max(low, last), max(high, last)))
    return whole


@dataclass(frozen=True, slots=True)
class WallFigures:
    """Figures of many drives: shares of length, lines for each wall, errors (m, degrees), false corners a room."""

    rooms: int
    walls: int
    found: float
    false: float
    lines_a_wall: float
    offset_mean_m: float
    offset_p95_m: float
    angle_mean_deg: float
    angle_p95_deg: float
    corners: int
    corners_found: float
    corner_mean_m: float
    corner_p95_m: float
    false_corners: float


def figures(trials: Sequence[WallTrial]) -> WallFigures:
    """Return the figures of these drives; errors are NaN where nothing right was reported."""
    offsets = np.array([offset for trial in trials for offset in trial.offsets_m])
    angles = np.degrees([angle for trial in trials for angle in trial.angles_rad])
    walls = sum(trial.walls for trial in trials)
    reported_m = sum(trial.reported_m for trial in trials)
    is_any = len(offsets) > 0
    corners = [trial.corners for trial in trials]
    errors = np.array([error for it in corners for error in it.errors_m])
    heard = sum(it.answered for it in corners)
    return WallFigures(
        rooms=len(trials),
        walls=walls,
        found=sum(trial.found_m for trial in trials) / max(sum(trial.answered_m for trial in trials), PLACE_M),
        false=sum(trial.false_m for trial in trials) / max(reported_m, PLACE_M),
        lines_a_wall=sum(trial.lines for trial in trials) / max(walls, 1),
        offset_mean_m=float(offsets.mean()) if is_any else math.nan,
        offset_p95_m=float(np.percentile(offsets, 95.0)) if is_any else math.nan,
        angle_mean_deg=float(angles.mean()) if is_any else math.nan,
        angle_p95_deg=float(np.percentile(angles, 95.0)) if is_any else math.nan,
        corners=heard,
        corners_found=sum(it.found for it in corners) / max(heard, 1),
        corner_mean_m=float(errors.mean()) if len(errors) else math.nan,
        corner_p95_m=float(np.percentile(errors, 95.0)) if len(errors) else math.nan,
        false_corners=sum(it.false for it in corners) / max(len(corners), 1),
    )
