"""The last echo of each sensor as a point in the odometry's frame: what the schemas are to keep clear of.

A sensor that fires again replaces its own echo and no other's; one that hears nothing clears it. So a reading at
maximum range leaves no obstacle behind, and neighbours do not erase each other's.
"""

from __future__ import annotations

import numpy as np

from drivers.messages import Firing
from perception.kernel import Floats


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
        fired = ~np.isnan(firing.ranges_m)
        heard = np.isfinite(firing.ranges_m)
        axis = firing.ring_yaw + self._mounts[heard, 2]
        c, s = np.cos(firing.ring_yaw), np.sin(firing.ring_yaw)
        x, y = self._mounts[heard, 0], self._mounts[heard, 1]
        reach = firing.ranges_m[heard]
        self._points[heard, 0] = firing.pose.x + c * x - s * y + reach * np.cos(axis)
        self._points[heard, 1] = firing.pose.y + s * x + c * y + reach * np.sin(axis)
        self._times[fired] = firing.t_s
        self._heard[fired] = heard[fired]

    def points(self, t: float, age_max_s: float) -> Floats:
        """Return the echoes not older than `age_max_s` at time `t`: shape (k, 2), m, a copy."""
        fresh: Floats = self._points[self._heard & (t - self._times <= age_max_s)]
        return fresh

    def clear(self) -> None:
        """Forget all echoes."""
        self._heard[:] = False
