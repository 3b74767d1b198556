"""The last echo of each sensor as a point in the odometry's frame: what the schemas are to keep clear of.

A sensor that fires again replaces its own echo and no other's; one that hears nothing clears it. So a reading at
maximum range leaves no obstacle behind, and neighbours do not erase each other's.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.messages import Firing
from perception.kernel import Floats, kernel


@kernel
def take_in(
    ranges: Floats, mounts: Floats, x: float, y: float, yaw: float, t: float, points: Floats, times: Floats,
    heard: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Enter a firing into `points` (n, 2), `times` (n,) and `heard` (n,); `ranges` as in a `Firing`, m and rad."""
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
        """Take in one firing."""
        pose = firing.pose
        take_in(
            firing.ranges_m, self._mounts, float(pose.x), float(pose.y), float(firing.ring_yaw), float(firing.robot_s),
            self._points, self._times, self._heard,
        )  # fmt: skip

    def points(self, t: float, age_max_s: float) -> Floats:
        """Return the echoes not older than `age_max_s` at time `t`: shape (k, 2), m, a copy."""
        fresh: Floats = self._points[self._heard & (t - self._times <= age_max_s)]
        return fresh

    def clear(self) -> None:
        """Forget all echoes."""
        self._heard[:] = False
