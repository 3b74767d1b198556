"""Keyframes: the readings of a short way, placed by odometry in the ring's frame at its end.

Two readings of one sensor that differ by a keyframe's way or turn have errors of their own, and each is entered once.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from drivers.messages import Firing, Pose, wrap_angle
from perception.bounds import COUNT, FINITE, PLACE, bounds, up_to
from perception.kernel import Floats
from perception.localization.known_room.particle_update import COLUMNS
from perception.shared_numbers import READING_M, READING_RAD

STAND_M: Final = 0.01
"""A robot that moves less than this, and turns less than `STAND_RAD`, while the ring fires as often as it has sensors
stands: that is a keyframe."""
STAND_RAD: Final = math.radians(1.0)
"""Turn in `STAND_M`."""
KEYFRAMES_MAX: Final = 128
"""Keyframes that are kept."""


class Keyframes:
    """The last keyframes of a run, each under its number modulo `KEYFRAMES_MAX`.

    Parameters
    ----------
    mounts : (n, 3) float
        Place (m) and direction (rad) of each sensor in the ring's frame.
    """

    SCRATCH: Final = ("_axes",)
    """What the settings give."""
    BOUNDS: Final = bounds(
        _latest=PLACE._replace(infinite=True),
        _firings=COUNT,
        _begin=PLACE,
        count=COUNT,
        odometry=PLACE,
        way_m=FINITE,
        readings=PLACE._replace(infinite=True),
        counts=lambda self: up_to(self.readings.shape[1]),
    )

    def __init__(self, mounts: Floats, turning: tuple[int, ...] = ()) -> None:
        self._turning = list(turning)
        self._axes = np.column_stack([mounts[:, :2], np.cos(mounts[:, 2]), np.sin(mounts[:, 2])])
        self._latest = np.zeros((len(mounts), 4))
        """The pose by odometry of each sensor's part of the ring when it last fired, and its range."""
        self._has_fired = np.zeros(len(mounts), dtype=np.bool_)
        """Since the last keyframe."""
        self._firings = 0
        self._is_started = self._has_stood = False
        self._begin = np.zeros(3)
        self.count = 0
        """Keyframes since the start."""
        self.odometry = np.zeros((KEYFRAMES_MAX, 3))
        """(KEYFRAMES_MAX, 3): the ring's pose at each keyframe's end by odometry, m and rad."""
        self.way_m = np.zeros(KEYFRAMES_MAX)
        """(KEYFRAMES_MAX,): way driven until then."""
        self.readings = np.zeros((KEYFRAMES_MAX, len(mounts), COLUMNS))
        """(KEYFRAMES_MAX, n, COLUMNS): as of `perception.localization.known_room.particle_update`."""
        self.counts = np.zeros(KEYFRAMES_MAX, dtype=np.int64)
        """(KEYFRAMES_MAX,): readings of each."""

    def observe(self, firing: Firing) -> bool:
        """Take a firing with its pose by odometry; return whether a keyframe ends with it."""
        x, y, yaw = firing.pose.x, firing.pose.y, firing.ring_yaw
        fired = ~np.isnan(firing.ranges_m)
        self._latest[fired, :3] = x, y, yaw
        self._latest[fired, 3] = firing.ranges_m[fired]
        if self._turning:
            turned = [i for i in self._turning if fired[i]]
            self._latest[turned, 2] = firing.pose.theta
        self._has_fired |= fired
        self._firings += 1
        if not self._is_started:
            self._is_started = True
            self._begin[:] = x, y, yaw
        begin_x, begin_y, begin_yaw = self._begin.tolist()
        way, turn = math.hypot(x - begin_x, y - begin_y), abs(wrap_angle(yaw - begin_yaw))
        has_moved = way >= READING_M or turn >= READING_RAD
        stands = way < STAND_M and turn < STAND_RAD and self._firings >= len(self._axes) and not self._has_stood
        if has_moved or stands:
            self._has_stood = stands
            self._end(x, y, yaw, way)
        return has_moved or stands

    def pose(self, number: int) -> Pose:
        """Return the ring's pose by odometry at the end of a keyframe."""
        x, y, yaw = self.odometry[number % KEYFRAMES_MAX].tolist()
        return Pose(x, y, yaw)

    def latest_ranges(self) -> Floats:
        """Return the ranges of the last keyframe, m, shape (readings,)."""
        row = (self.count - 1) % KEYFRAMES_MAX
        return self.readings[row, : self.counts[row], -1]

    def begin(self) -> None:
        """Begin a keyframe with the next firing; a robot that stands makes one again."""
        self._has_fired[:] = False
        self._firings = 0
        self._is_started = self._has_stood = False

    @property
    def is_stand(self) -> bool:
        """Whether the last keyframe is of a robot that stands."""
        return self._has_stood

    @property
    def driven_m(self) -> float:
        """Way driven until the end of the last keyframe, m."""
        return float(self.way_m[(self.count - 1) % KEYFRAMES_MAX])

    def way_of(self, number: int) -> float:
        """Return the way from the keyframe before to the end of this one, m; 0 for the oldest one."""
        if number <= max(0, self.count - KEYFRAMES_MAX):
            return 0.0
        return float(self.way_m[number % KEYFRAMES_MAX] - self.way_m[(number - 1) % KEYFRAMES_MAX])

    def way_since(self, number: int) -> float:
        """Return the way from the end of a keyframe to that of the last one, m."""
        return self.driven_m - float(self.way_m[number % KEYFRAMES_MAX])

    def compounded(self, first: int, most: int) -> Floats:
        """Return readings of all keyframes from one on, in the frame of that one.

        Parameters
        ----------
        first : int
            Number of that keyframe, which must still be kept.
        most : int
            So many readings are chosen at most, evenly.

        Returns
        -------
        (n, COLUMNS) float
        """
        rows = np.arange(first, self.count) % KEYFRAMES_MAX
        is_reading = np.arange(self.readings.shape[1]) < self.counts[rows, None]
        found = self.readings[rows][is_reading]
        x0, y0, yaw0 = self.odometry[rows[0]].tolist()
        x, y, yaw = np.repeat(self.odometry[rows], self.counts[rows], axis=0).T
        turned = _turned(found, yaw - yaw0)
        cos, sin = math.cos(yaw0), math.sin(yaw0)
        turned[:, 0] += cos * (x - x0) + sin * (y - y0)
        turned[:, 1] += cos * (y - y0) - sin * (x - x0)
        chosen = np.linspace(0, len(turned) - 1, min(most, len(turned)))
        return np.asarray(turned[np.unique(chosen.astype(np.int64))])

    def _end(self, x: float, y: float, yaw: float, way: float) -> None:
        """End a keyframe at this pose of the ring by odometry."""
        row, before = self.count % KEYFRAMES_MAX, (self.count - 1) % KEYFRAMES_MAX
        fired = np.flatnonzero(self._has_fired)
        at_x, at_y, at_yaw, range_m = self._latest[fired].T
        readings = np.column_stack([self._axes[fired], range_m])
        placed = _turned(readings, at_yaw - yaw)
        cos, sin = math.cos(yaw), math.sin(yaw)
        placed[:, 0] += cos * (at_x - x) + sin * (at_y - y)
        placed[:, 1] += cos * (at_y - y) - sin * (at_x - x)
        self.readings[row, : len(fired)] = placed
        self.counts[row] = len(fired)
        self.odometry[row] = x, y, yaw
        self.way_m[row] = way + (self.way_m[before] if self.count else 0.0)
        self.count += 1
        self._has_fired[:] = False
        self._firings = 0
        self._begin[:] = x, y, yaw


def _turned(readings: Floats, angle: Floats) -> Floats:
    """Return readings turned about the origin, each by an angle (rad)."""
    cos, sin = np.cos(angle), np.sin(angle)
    x, y, c, s, range_m = readings.T
    return np.column_stack([cos * x - sin * y, sin * x + cos * y, cos * c - sin * s, sin * c + cos * s, range_m])
