"""The last echo of each sensor as a point in the odometry's frame: the obstacles that the schemas avoid.

A new reading of a sensor replaces only that sensor's echo; a reading without an echo removes it. So a reading at
maximum range leaves no obstacle, and neighbours do not erase each other's echoes.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.messages import Firing
from perception.kernel import Floats, kernel


@kernel
def record_echoes(
    ranges: Floats, mounts: Floats, x: float, y: float, yaw: float, t: float, points: Floats, times: Floats,
    heard: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Enter the readings of a firing.

    Parameters
    ----------
    ranges : (n,) float
        As in a `Firing`, m.
    mounts : (n, 3) float
        x, y (m), direction (rad) of each sensor in the ring's frame.
    x, y, yaw, t : float
        Place (m) and direction (rad) of the ring, time of the firing (s).
    points : (n, 2) float
        Place of each sensor's last echo, m. Updated.
    times : (n,) float
        When each sensor last fired, s. Updated.
    heard : (n,) bool
        Whether it heard an echo then. Updated.
    """
    c = math.cos(yaw)
    s = math.sin(yaw)
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if math.isnan(r):
            continue
        times[i] = t
        heard[i] = math.isfinite(r)
        if heard[i]:
            points[i, 0] = x + c * mounts[i, 0] - s * mounts[i, 1] + r * math.cos(yaw + mounts[i, 2])
            points[i, 1] = y + s * mounts[i, 0] + c * mounts[i, 1] + r * math.sin(yaw + mounts[i, 2])


class FreshEchoes:
    """Each sensor's last echo.

    Parameters
    ----------
    mounts : (n, 3) float
        x, y (m), direction (rad) of each sensor in the ring's frame.
    """

    def __init__(self, mounts: Floats) -> None:
        self._mounts = mounts
        self._points = np.zeros((len(mounts), 2))
        self._times = np.zeros(len(mounts))
        self._heard = np.zeros(len(mounts), dtype=np.bool_)

    def update(self, firing: Firing) -> None:
        """Enter the echoes of a firing."""
        pose = firing.pose
        record_echoes(
            firing.ranges_m, self._mounts, float(pose.x), float(pose.y), float(firing.ring_yaw),
            float(firing.robot_s), self._points, self._times, self._heard,
        )  # fmt: skip

    def points(self, robot_s: float, age_max_s: float) -> Floats:
        """Return a copy of the echoes no older than `age_max_s` at the robot's time `robot_s`: shape (k, 2), m."""
        fresh: Floats = self._points[self._heard & (robot_s - self._times <= age_max_s)]
        return fresh

    def clear(self) -> None:
        """Remove all echoes."""
        self._heard[:] = False
