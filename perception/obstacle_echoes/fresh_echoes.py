"""The last usable readings of each sensor in the odometry's frame: the obstacles to avoid, and where the ring looked.

A new reading of a sensor replaces only what that sensor heard in the same direction; a reading without an echo
removes it. So a reading at maximum range leaves no obstacle, and neighbours do not erase each other's echoes. A ring
that turns keeps what it heard in other directions. A sensor that reports a fault, or whose reading is not believed,
has not looked: its last echo ages.

A look whose echo is replaced still counts as a look. Neighbours whose beams just touch fire one after the other:
while the ring turns, only the looks before close the gap that the turn leaves between their newest ones.

Steady echoes that fall silent as the robot comes nearer are kept apart (`perception.obstacle_echoes.unheard_echoes`).
While no sensor hears anything, they stay obstacles and do not age. A ring with wide gaps remembers the walls beside
it, too (`perception.obstacle_echoes.blind_walls`).
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from drivers.messages import Firing, Pose
from perception.angles import SAME_RAD, wrapped
from perception.bounds import CONSTANT, PLACE, bounds
from perception.kernel import Floats, entry_kernel, kernel
from perception.obstacle_echoes.blind_walls import BlindWalls
from perception.obstacle_echoes.unheard_echoes import (
    ALONE,
    SILENT,
    UNCHANGED,
    UnheardEcho,
    UnheardEchoes,
    contradict_echoes,
    keep_sudden,
    lose_echo,
)
from perception.records import Records
from perception.sensor_mounts import RingPose, mounts_at, ring_pose, sensor_pose
from perception.shared_numbers import SAME_ECHO_M

LOOKS_REMEMBERED: Final = 16
"""Readings of each sensor that are kept, each in a direction of its own; in a turn faster than this holds, fewer."""
SAME_MAX: Final = 4
"""Looks of a sensor in one direction that are kept: the newest ones, which close gaps although a reading of either
neighbour fails, and the oldest, as the beams of those between lie within its own and the newest."""
STEADY_S: Final = 1.5
"""An echo is steady if another look, by whichever sensor, put one within `SAME_ECHO_M` no longer ago than this."""

TOLERANCE_M: Final = 0.005
"""A reading within this of the ring's reach is a silence: so some rings report it, m."""


class KeptLooks(NamedTuple):
    """The last looks of each sensor, the newest anywhere among them."""

    points: Floats
    """(n, looks, 2): places of the echoes, m."""
    bearings: Floats
    """(n, looks): directions in which each sensor looked, rad."""
    times: Floats
    """(n, looks): when it did, s; −inf where none is kept."""
    heard: NDArray[np.bool_]
    """(n, looks): whether it heard an echo then."""
    steady: NDArray[np.bool_]
    """(n, looks): whether another look agreed with that echo."""


@kernel
def is_steady(kept: KeptLooks, px: float, py: float, t: float) -> bool:
    """Return whether a look not long before put an echo near a place.

    Parameters
    ----------
    kept : KeptLooks
        The looks.
    px, py : float
        The place, m.
    t : float
        Time of the firing, s.
    """
    points, times, heard = kept.points, kept.times, kept.heard
    for j in range(times.shape[0]):
        for k in range(times.shape[1]):
            is_young = heard[j, k] and t - times[j, k] <= STEADY_S
            if is_young and math.hypot(points[j, k, 0] - px, points[j, k, 1] - py) < SAME_ECHO_M:
                return True
    return False


@kernel
def forget_look(bearing: float, same: float, bearings: Floats, times: Floats, heard: NDArray[np.bool_]) -> int:
    """Forget the echoes of a sensor that a new look replaces, and return which of its looks is the least use.

    Parameters
    ----------
    bearing, same
        Direction of the new look, and the angle up to which others are in the same one, rad.
    bearings, times, heard : (looks,)
        As in `KeptLooks`, of this sensor. Updated.
    """
    oldest = 0  # of all
    first = -1  # the oldest in the same direction, and the one after it
    second = -1
    in_direction = 0
    for k in range(times.shape[0]):
        turned = abs(wrapped(bearing - bearings[k]))
        if times[k] > -math.inf and turned <= same:
            heard[k] = False
            if turned <= SAME_RAD:
                times[k] = -math.inf
            else:
                in_direction += 1
                if first < 0 or times[k] < times[first]:
                    second = first
                    first = k
                elif second < 0 or times[k] < times[second]:
                    second = k
        if times[k] < times[oldest]:
            oldest = k
    return second if in_direction >= SAME_MAX else oldest


@entry_kernel
def record_echoes(
    ranges: Floats,
    mounts: Floats,
    pose: RingPose,
    t: float,
    same: float,
    reach: float,
    kept: KeptLooks,
    agreed: NDArray[np.bool_],
    unheard: Records[UnheardEcho],
) -> None:
    """Enter the readings of a firing.

    Parameters
    ----------
    ranges : (n,) float
        As in a `Firing`, m.
    mounts : (n, 3) float
        x, y (m), direction (rad) of each sensor in the ring's frame.
    pose : RingPose
        Place (m) and direction (rad) of the ring.
    t : float
        Time of the firing, s.
    same : float
        Angle up to which a new look replaces the echo of an older one of the same sensor, rad.
    reach : float
        Range up to which the ring listens, m; a reading there is a silence to `unheard`.
    kept : KeptLooks
        The looks. Updated.
    agreed : (n,) bool
        Whether another look agrees with the echo of this firing. Overwritten.
    unheard : (n,) records
        The echoes that a silence removed. Updated.
    """
    x, y, _ = pose
    points, bearings, times, heard, steady = kept
    for i in range(ranges.shape[0]):
        r = ranges[i]
        agreed[i] = False
        if math.isnan(r):
            continue
        own_x, own_y, bearing = sensor_pose(mounts, i, pose)
        is_echo = math.isfinite(r)
        away = r if is_echo else 0.0
        px, py = own_x + away * math.cos(bearing), own_y + away * math.sin(bearing)
        agreed[i] = is_echo and is_steady(kept, px, py, t)
        if r >= reach:
            for k in range(times.shape[1]):
                if heard[i, k] and abs(wrapped(bearing - bearings[i, k])) <= same:
                    lose_echo(unheard[i], points[i, k, 0], points[i, k, 1], steady[i, k], x, y)
        k = forget_look(bearing, same, bearings[i], times[i], heard[i])
        bearings[i, k] = bearing
        times[i, k] = t
        heard[i, k] = is_echo
        steady[i, k] = agreed[i]
        if is_echo:
            points[i, k, 0] = px
            points[i, k, 1] = py


@kernel
def select_looks(
    kept: KeptLooks,
    robot_s: float,
    age_max_s: float,
    fresh: Floats,
    ages: Floats,
    sensor_ages: Floats,
    fresh_points: Floats,
) -> tuple[int, int]:
    """Find the looks that are young enough, their echoes, and how long ago each sensor last looked.

    Parameters
    ----------
    kept : KeptLooks
        The looks.
    robot_s : float
        The robot's time now, s.
    age_max_s : float
        Looks older than this are left out, s.
    fresh, ages : (n · looks,) float
        The first k are the bearings and ages of the looks, rad and s, sensor by sensor. Overwritten.
    sensor_ages : (n,) float
        Age of each sensor's last look, s; infinite for one that has not looked yet. Overwritten.
    fresh_points : (n · looks, 2) float
        The first h are the places of the echoes among them, m. Overwritten.

    Returns
    -------
    (int, int)
        k and h, the numbers of looks and of echoes.
    """
    points, bearings, times, heard, _ = kept
    k = 0
    h = 0
    for i in range(times.shape[0]):
        sensor_ages[i] = math.inf
        for j in range(times.shape[1]):
            age = robot_s - times[i, j]
            sensor_ages[i] = min(sensor_ages[i], age)
            if age <= age_max_s:
                fresh[k] = bearings[i, j]
                ages[k] = age
                k += 1
                if heard[i, j]:
                    fresh_points[h, 0] = points[i, j, 0]
                    fresh_points[h, 1] = points[i, j, 1]
                    h += 1
    return k, h


class Looks(NamedTuple):
    """What the ring has seen lately."""

    bearings_rad: Floats
    """(k,): where it looked, sensor by sensor, rad."""
    ages_s: Floats
    """(k,): how long ago, s."""
    sensor_ages_s: Floats
    """(n,): how long ago each sensor last looked, s; infinite for one that has not looked yet."""
    points: Floats
    """(h, 2): the places of the echoes that it heard there, m."""


class FreshEchoes:
    """Each sensor's last usable readings.

    Parameters
    ----------
    mounts : (n, 3) float
        x, y (m), direction (rad) of each sensor in the ring's frame.
    half_angle : float
        Half the width of a beam, rad. A look within half of it of an older one is in the same direction.
    turning : tuple of int
        The sensors that turn with the wheels, as `config.robot.RingConfig.turning`.
    reach_m : float
        Range up to which the ring listens, m.
    sensor_of : tuple of int
        As `config.robot.RingConfig.sensor_of`; each mount is a sensor of its own if it is left out.
    """

    SCRATCH: Final = ("_agreed", "_kept")
    """Not part of a snapshot: overwritten before each use, or arrays that are."""
    BOUNDS: Final = bounds(
        _mounts=CONSTANT,
        _half_angle=CONSTANT,
        _points=PLACE,
        _bearings=PLACE,
        _times=PLACE._replace(infinite=True),
        _heard_reach_m=CONSTANT,
        _radius_m=CONSTANT,
    )

    def __init__(
        self,
        mounts: Floats,
        half_angle: float,
        turning: tuple[int, ...] = (),
        reach_m: float = math.inf,
        sensor_of: tuple[int, ...] = (),
    ) -> None:
        self._mounts, self._turning = mounts, turning
        self.set_reach(reach_m)
        self._half_angle = half_angle
        self._points = np.zeros((len(mounts), LOOKS_REMEMBERED, 2))
        self._bearings = np.zeros((len(mounts), LOOKS_REMEMBERED))
        self._times = np.full((len(mounts), LOOKS_REMEMBERED), -math.inf)
        self._heard = np.zeros((len(mounts), LOOKS_REMEMBERED), dtype=np.bool_)
        self._steady = np.zeros((len(mounts), LOOKS_REMEMBERED), dtype=np.bool_)
        self._kept = KeptLooks(self._points, self._bearings, self._times, self._heard, self._steady)
        self._agreed = np.zeros(len(mounts), dtype=np.bool_)
        self._radius_m = max(math.hypot(*mount[:2]) for mount in mounts.tolist())
        self.unheard = UnheardEchoes(mounts, sensor_of)
        """What the ring has lost."""
        self._walls = BlindWalls(mounts, half_angle, turning)

    def set_reach(self, reach_m: float) -> None:
        """Expect echoes up to another range, m."""
        self._heard_reach_m = reach_m - TOLERANCE_M

    def update(self, firing: Firing) -> None:
        """Enter the echoes of a firing."""
        pose, core = ring_pose(firing), 0.5 * self._half_angle
        mounts = mounts_at(firing, self._mounts, self._turning)
        record_echoes(
            firing.ranges_m,
            mounts,
            pose,
            float(firing.robot_s),
            core,
            self._heard_reach_m,
            self._kept,
            self._agreed,
            self.unheard.records,
        )
        reception, robot_s = (core, self._heard_reach_m, self._radius_m), float(firing.robot_s)
        self.unheard.remembered.enter(firing.ranges_m, mounts, pose, robot_s, reception, self._agreed)
        heard_new = not self.unheard.silences[UNCHANGED]
        contradict_echoes(
            firing.ranges_m,
            mounts,
            pose,
            core,
            self._heard_reach_m,
            self._radius_m,
            self._agreed,
            self.unheard.records,
            self.unheard.silences,
        )
        if self.unheard.falls_silent(SILENT) or self.unheard.falls_silent(UNCHANGED):
            since = float(firing.robot_s) - STEADY_S if self.unheard.falls_silent(SILENT) else math.inf
            heard = self._in_beams(pose, mounts) if self._walls.is_blind else self._heard
            keep_sudden(self._points, self._times, heard, self._steady, since, pose[0], pose[1], self.unheard.records)
        if self._walls.is_blind:
            if self.unheard.is_ring_silent:
                self._walls.look_again(pose[0], pose[1], self.unheard.has_been_silent)
            elif not self.unheard.has_been_silent:
                self._walls.has_looked_round = False
        if heard_new and self.unheard.silences[UNCHANGED]:
            self.unheard.presume_walls(pose[0], pose[1], self._walls)
        self._walls.update(firing)

    def _in_beams(self, pose: RingPose, mounts: Floats) -> NDArray[np.bool_]:
        """Return which echoes lie in a beam now, shape (n, looks): a turn takes few sensors away from all others."""
        x, y, yaw = pose
        bearings = np.arctan2(self._points[..., 1] - y, self._points[..., 0] - x)
        off = np.remainder(bearings[..., None] - yaw - mounts[:, 2] + math.pi, math.tau) - math.pi
        inside: NDArray[np.bool_] = self._heard & (np.abs(off) <= self._half_angle).any(axis=-1)
        return inside

    def points(self, robot_s: float, age_max_s: float) -> Floats:
        """Return a copy of the echoes no older than `age_max_s` at the robot's time `robot_s`: shape (k, 2), m."""
        return self.looks(robot_s, age_max_s).points

    def steady_points(self, robot_s: float, age_max_s: float) -> Floats:
        """Return a copy of those echoes with which another look agrees, shape (k, 2), m: no random ones."""
        fresh: Floats = self._points[self._heard & self._steady & (robot_s - self._times <= age_max_s)]
        return fresh

    def looks(self, robot_s: float, age_max_s: float) -> Looks:
        """Return what the ring has seen up to `age_max_s` before the robot's time `robot_s`, as copies."""
        size = self._times.size
        fresh, ages, points = np.empty(size), np.empty(size), np.empty((size, 2))
        sensor_ages = np.empty(len(self._times))
        k, h = select_looks(self._kept, float(robot_s), float(age_max_s), fresh, ages, sensor_ages, points)
        echoes = points[:h]
        if self.unheard.is_ring_silent:
            echoes = np.concatenate([echoes, self.unheard.points(ALONE)])
        return Looks(fresh[:k], ages[:k], sensor_ages, echoes)

    def with_blind_sides(self, points: Floats, pose: Pose, axes_rad: Floats) -> tuple[Floats, Floats, Floats]:
        """Return echoes with those of remembered walls, the directions of which nothing is known, and presumed feet.

        Parameters
        ----------
        points : (h, 2) float
            Places of echoes, m.
        pose, axes_rad
            As of `BlindWalls.sides`.
        """
        if not self._walls.has_gaps:
            return points, np.zeros(0), np.zeros((0, 2))
        walls, unknown, presumed = self._walls.sides(pose, axes_rad)
        return np.concatenate([points, walls]), unknown, presumed

    def clear(self) -> None:
        """Remove all readings."""
        self._walls.clear()
        self._heard[:] = False
        self._steady[:] = False
        self.unheard.clear()
        self._times[:] = -math.inf
