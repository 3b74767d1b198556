"""filterpy's extended Kalman filter: one filter per track, its state the centre's x and y, updated range by range."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from bench.association import Evidence
from bench.estimator import Peer, Tracks
from bench.front_end import RADIUS_M
from bench.noise import INITIAL_SIGMA_M, RANGE_SIGMA_M
from drivers.messages import Floats

INNOVATION_SIGMAS: Final = 3.5
"""A range farther off than this many standard deviations of its innovation is an outlier."""


def expected(state: Floats, x: float, y: float) -> Floats:
    """Return the range to the surface of the drum at `state` from (x, y), shape (1,)."""
    return np.array([math.hypot(state[0] - x, state[1] - y) - RADIUS_M])


def jacobian(state: Floats, x: float, y: float) -> Floats:
    """Return the derivative of `expected` by the state, shape (1, 2)."""
    dx, dy = state[0] - x, state[1] - y
    distance = math.hypot(dx, dy)
    return np.array([[dx / distance, dy / distance]])


class Filters(Tracks):
    """One extended Kalman filter per track."""

    def __init__(self) -> None:
        super().__init__()
        self._filters: dict[int, Any] = {}

    def update(self, evidence: Evidence) -> None:
        """Update the filters with their ranges."""
        for track, place in evidence.initiated.items():
            ekf = ExtendedKalmanFilter(dim_x=2, dim_z=1)
            ekf.x = np.array(place)
            ekf.P = np.eye(2) * INITIAL_SIGMA_M**2
            ekf.R = np.array([[RANGE_SIGMA_M**2]])
            self._filters[track] = ekf
            self.places[track] = place
        for hit in evidence.ranges:
            ekf = self._filters.get(hit.track)
            if ekf is None:
                continue
            sensor = (hit.x, hit.y)
            toward = jacobian(ekf.x, *sensor)
            innovation = hit.range_m - expected(ekf.x, *sensor)[0]
            variance = (toward @ ekf.P @ toward.T)[0, 0] + RANGE_SIGMA_M**2
            if innovation * innovation > INNOVATION_SIGMAS**2 * variance:
                continue
            ekf.update(np.array([hit.range_m]), jacobian, expected, args=sensor, hx_args=sensor)
            self.places[hit.track] = (float(ekf.x[0]), float(ekf.x[1]))


PEER: Final = Peer("filterpy EKF", "filterpy", Filters)
