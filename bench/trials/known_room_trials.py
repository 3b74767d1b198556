"""Drives through furnished rooms that are known, with faulty odometry and an unknown start, and the truth."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from bench.trials.furnished_rooms import ACOUSTICS, drive, furnished_room, with_moved_wall
from bench.trials.large_building import Building
from config.robot import RingConfig
from config.world import AcousticsConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import firing_pattern, sensors
from drivers.messages import Firing, Floats, Pose, wrap_angle
from perception.localization.known_room.known_room import KnownRoom
from perception.localization.localized_pose import Status
from perception.localization.room.room import Room, room_of

STEP_M: Final = 0.03
"""Way between two firings of a part of the ring."""
STAND_FIRINGS: Final = 30
"""Firings of a robot that stands."""
TURN_STEP_RAD: Final = math.radians(4.0)
"""Turn between two firings where the robot turns on the spot."""
SCALE_ERROR: Final = 0.03
TURN_ERROR: Final = 0.02
HEADING_WALK: Final = math.radians(0.5)
"""Odometry: greatest errors of scale and of turns as a share, and random walk of the heading, rad/√m."""
RIGHT_M: Final = 0.5
RIGHT_RAD: Final = math.radians(10.0)
"""A place is right within these."""
SURE: Final = 0.9
"""A probability above this counts as an answer."""
NOTICE_M: Final = 1.0
"""Way after the robot was carried on which a wrong answer is not counted as one."""


@dataclass(frozen=True, slots=True)
class KnownDrive:
    """Firings of one drive, and where they were.

    Attributes
    ----------
    room : Room
        The map.
    firings : list of Firing
        Poses by odometry.
    truth : (n, 3) float
        Poses of the ring in the map frame, m and rad.
    carried_at : int or None
        Index of the first firing after the robot was carried.
    """

    room: Room
    firings: list[Firing]
    truth: Floats
    carried_at: int | None = None

    def way_m(self) -> Floats:
        """Return the way driven until each firing, m."""
        steps = np.hypot(*np.diff(self.truth[:, :2], axis=0).T)
        if self.carried_at is not None:
            steps[self.carried_at - 1] = 0.0
        return np.concatenate([[0.0], np.cumsum(steps)])


def furnished_drive(
    ring: RingConfig,
    seed: int,
    acoustics: AcousticsConfig = ACOUSTICS,
    length_m: float = 15.0,
    kidnapped: bool = False,
    standing: bool = False,
    moved_wall_m: float = 0.0,
) -> KnownDrive:
    """Return a drive through a furnished room.

    Parameters
    ----------
    ring : RingConfig
        The ring. It keeps its direction in rooms of even seeds, as on a synchro drive, and turns with the wheels in
        the others.
    seed : int
        Of room, drive and errors.
    acoustics : AcousticsConfig
        How the room reflects, and the errors of the ranges.
    length_m : float
        Length of the drive, m.
    kidnapped : bool
        Whether the robot is carried to another place of the room after this way, and drives as far again from there;
        its odometry does not notice.
    standing : bool
        Whether the robot stands at the start instead, for `STAND_FIRINGS`.
    moved_wall_m : float
        A wall stands so much farther out than in the map, m.
    """
    mapped = furnished_room(seed, acoustics)
    room = with_moved_wall(mapped, moved_wall_m)
    truth = _path(drive(room, seed, STEP_M, length_m), seed)
    if standing:
        truth = np.repeat(truth[:1], STAND_FIRINGS, axis=0)
    carried_at = len(truth) if kidnapped else None
    if kidnapped:
        truth = np.concatenate([truth, _path(drive(room, seed + 500_000, STEP_M, length_m), seed)])
    heard = heard_on_the_way(ring, room.world, truth, seed, carried_at)
    return replace(heard, room=room_of(mapped.world))


def building_drive(ring: RingConfig, building: Building, seed: int, length_m: float) -> KnownDrive:
    """Return a drive through some rooms of a large building; the ring keeps its direction.

    Parameters
    ----------
    ring : RingConfig
        The ring.
    building : Building
        The building, with its acoustics.
    seed : int
        Of drive and errors.
    length_m : float
        Length of the drive, m.
    """
    return heard_on_the_way(ring, building.world, building.drive(seed, STEP_M, length_m), seed)


def heard_on_the_way(
    ring: RingConfig, world: WorldConfig, truth: Floats, seed: int, carried_at: int | None = None
) -> KnownDrive:
    """Return the firings of a drive through a world, with faulty odometry.

    Parameters
    ----------
    ring : RingConfig
        The ring.
    world : WorldConfig
        The world, with its acoustics.
    truth : (n, 3) float
        Poses of the ring, m and rad.
    seed : int
        Of the errors.
    carried_at : int, optional
        Index of a pose to which the robot was carried.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 16]))
    sonar, pattern = Sonar(ring, compile_scene(world), world.acoustics, rng), firing_pattern(ring)
    firings = []
    for k, (odometry, row) in enumerate(zip(drifting_odometry(truth, rng, carried_at), truth.tolist(), strict=True)):
        pose = Pose(*row)
        ranges = sonar.fire(pose, pose.theta, sensors(pattern.masks[k % len(pattern.masks)]))
        firings.append(Firing(k * ring.firing.step_period_s, odometry, odometry.theta, ranges))
    return KnownDrive(room_of(world), firings, truth, carried_at)


def _path(poses: Floats, seed: int) -> Floats:
    """Return the poses of the ring: in rooms of odd seeds it looks where the robot drives, and turns on the spot."""
    if seed % 2 == 0:
        return poses
    ahead = np.diff(poses[:, :2], axis=0)
    heading = np.unwrap(np.append(np.arctan2(ahead[:, 1], ahead[:, 0]), 0.0)[: len(ahead)])
    rows = [np.array([*poses[0, :2], heading[0]])]
    for place, theta in zip(poses[1:-1, :2], heading[1:].tolist(), strict=True):
        before = float(rows[-1][2])
        turn = wrap_angle(theta - before)
        steps = max(1, math.ceil(abs(turn) / TURN_STEP_RAD))
        rows += [np.array([*place, before + turn * part / steps]) for part in range(1, steps + 1)]
    return np.array(rows)


def drifting_odometry(truth: Floats, rng: np.random.Generator, carried_at: int | None = None) -> list[Pose]:
    """Return what odometry makes of a path: it begins at its own origin, and drifts.

    Parameters
    ----------
    truth : (n, 3) float
        The path, m and rad.
    rng : numpy.random.Generator
        Source of its errors.
    carried_at : int, optional
        Index of a pose to which the robot was carried: odometry does not notice.
    """
    scale, turn_scale = 1.0 + SCALE_ERROR * rng.choice([-1.0, 1.0]), 1.0 + TURN_ERROR * rng.choice([-1.0, 1.0])
    here = Pose(*(float(rng.uniform(-half, half)) for half in (5.0, 5.0, math.pi)))
    found = [here]
    for k in range(1, len(truth)):
        if k != carried_at:
            step = Pose(*truth[k - 1].tolist()).inverse().compose(Pose(*truth[k].tolist()))
            walk = HEADING_WALK * math.sqrt(math.hypot(step.x, step.y)) * float(rng.standard_normal())
            here = here.compose(Pose(scale * step.x, scale * step.y, turn_scale * wrap_angle(step.theta) + walk))
        found.append(here)
    return found


@dataclass(frozen=True, slots=True)
class Trace:
    """What was said at each firing of a drive, with its errors; arrays of shape (n,), m and rad."""

    way_m: Floats
    error_m: Floats
    error_rad: Floats
    probability: Floats
    status: tuple[Status, ...]
    carried_at: int | None = None
    """Index of the first firing after the robot was carried."""

    @property
    def right(self) -> NDArray[np.bool_]:
        """Whether the place was right, shape (n,)."""
        return np.asarray((self.error_m < RIGHT_M) & (self.error_rad < RIGHT_RAD))


def follow(localizer: KnownRoom, drive: KnownDrive, costs_s: list[float] | None = None) -> Trace:
    """Return what a localizer says along a drive.

    Parameters
    ----------
    localizer : KnownRoom
        The localizer, before its first firing.
    drive : KnownDrive
        Its firings, and the truth.
    costs_s : list of float, optional
        Gets the thread time of each firing, all quanta included, s.
    """
    rows, status = [], []
    for firing, (x, y, theta) in zip(drive.firings, drive.truth.tolist(), strict=True):
        begin_s = time.thread_time()
        localizer.observe(firing)
        while localizer.can_refine:
            localizer.refine()
        if costs_s is not None:
            costs_s.append(time.thread_time() - begin_s)
        here = localizer.localized()
        off = math.hypot(here.pose.x - x, here.pose.y - y)
        rows.append((off, abs(wrap_angle(here.ring_yaw - theta)), here.probability))
        status.append(here.status)
    error_m, error_rad, probability = np.array(rows).T
    return Trace(drive.way_m(), error_m, error_rad, probability, tuple(status), drive.carried_at)


@dataclass(frozen=True, slots=True)
class RoomFigures:
    """Figures of many drives.

    Attributes
    ----------
    drives, found : int
        Drives, and those in which the right place was given with a probability above `SURE`.
    way_median_m, way_max_m : float
        Way until then; of those that found it, and of all.
    kidnapped, recovered : int
        Drives in which the robot was carried, and those in which it found the right place again.
    noticed_max_m, recovered_max_m : float
        Way after it was carried until no wrong place was given any more, and until the right one was.
    median_m, p95_m, median_deg, p95_deg : float
        Errors while tracking the right place.
    said, said_wrong : int
        Firings at which a place was given with a probability above `SURE`, and those at which it was wrong, without
        those on the first `NOTICE_M` after the robot was carried.
    drives_said_wrong : int
        Drives with one of the latter.
    lost_share : float
        Share of the firings at which the robot said that it was lost.
    """

    drives: int
    found: int
    way_median_m: float
    way_max_m: float
    kidnapped: int
    recovered: int
    noticed_max_m: float
    recovered_max_m: float
    median_m: float
    p95_m: float
    median_deg: float
    p95_deg: float
    said: int
    said_wrong: int
    drives_said_wrong: int
    lost_share: float


def figures(traces: Sequence[Trace]) -> RoomFigures:
    """Return the figures of these drives; at least one must have tracked the right place."""
    ways, noticed, recovered, said, wrong, drives_wrong, lost = [], [], [], 0, 0, 0, 0
    error_m, error_rad = [], []
    for trace in traces:
        tracking = np.array([one == "tracking" for one in trace.status])
        sure = tracking & (trace.probability > SURE)
        carried_m = math.inf if trace.carried_at is None else float(trace.way_m[trace.carried_at])
        before = np.arange(len(sure)) < (len(sure) if trace.carried_at is None else trace.carried_at)
        ways.append(_first(trace.way_m, sure & trace.right & before))
        if trace.carried_at is not None:
            wrong_at = np.flatnonzero(sure & ~trace.right & ~before)
            noticed.append(float(trace.way_m[wrong_at[-1]]) - carried_m if len(wrong_at) else 0.0)
            recovered.append(_first(trace.way_m, sure & trace.right & ~before) - carried_m)
        unnoticed = ~before & (trace.way_m < carried_m + NOTICE_M)
        wrong_here = int((sure & ~trace.right & ~unnoticed).sum())
        said, wrong, drives_wrong = said + int(sure.sum()), wrong + wrong_here, drives_wrong + bool(wrong_here)
        lost += sum(one == "lost" for one in trace.status)
        error_m.append(trace.error_m[tracking & trace.right])
        error_rad.append(trace.error_rad[tracking & trace.right])
    off_m, off_deg = np.concatenate(error_m), np.degrees(np.concatenate(error_rad))
    found = [way for way in ways if math.isfinite(way)]
    return RoomFigures(
        drives=len(traces),
        found=len(found),
        way_median_m=float(np.median(found)) if found else math.inf,
        way_max_m=max(ways),
        kidnapped=len(recovered),
        recovered=sum(map(math.isfinite, recovered)),
        noticed_max_m=max(noticed, default=0.0),
        recovered_max_m=max(recovered, default=0.0),
        median_m=float(np.median(off_m)),
        p95_m=float(np.quantile(off_m, 0.95)),
        median_deg=float(np.median(off_deg)),
        p95_deg=float(np.quantile(off_deg, 0.95)),
        said=said,
        said_wrong=wrong,
        drives_said_wrong=drives_wrong,
        lost_share=lost / sum(len(trace.status) for trace in traces),
    )


def _first(way_m: Floats, where: NDArray[np.bool_]) -> float:
    """Return the way at the first firing of these, m; inf if there is none."""
    index = np.flatnonzero(where)
    return float(way_m[index[0]]) if len(index) else math.inf
