"""A polyline: an outline of what echoes but is not straight."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from drivers.messages import IDENTITY, Floats, Pose


@dataclass(frozen=True, slots=True, eq=False)
class Polyline:
    """The outline of something that is not straight, in the odometry's frame."""

    number: int
    """The same for the same polyline as long as it exists; the numbers of objects are another sequence."""
    points: Floats
    """(n, 2): x, y of its points in order, m; n ≥ 2. It is not closed, unless the last point is the first."""
    probability: float
    """Probability that something stands along it, from 0 to 1."""

    @property
    def length_m(self) -> float:
        """Length of its pieces together, m."""
        return float(np.hypot(*np.diff(self.points, axis=0).T).sum())

    def in_frame(self, to: Pose) -> Polyline:
        """Return it in another frame, in which the present origin lies at `to`."""
        if to == IDENTITY:
            return self
        c, s = math.cos(to.theta), math.sin(to.theta)
        x, y = self.points.T
        return replace(self, points=np.column_stack((to.x + c * x - s * y, to.y + s * x + c * y)))
