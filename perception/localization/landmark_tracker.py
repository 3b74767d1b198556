"""The landmark filter along a drive: it follows odometry, enters firings, and learns how far the heading wanders."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from config.robot import RingConfig
from drivers.messages import Pose, wrap_angle
from perception.kernel import Floats
from perception.localization.landmark_filter import propagate, rows_used, write_lever
from perception.localization.landmark_ranges import update_with_firing
from perception.localization.landmark_state import (
    HEADING,
    ODOMETER,
    OFFSET,
    RANGE,
    ROWS_MAX,
    TURN,
    Estimate,
    X,
    Y,
)
from perception.records import records, zeros
from perception.sensor_mounts import mounts_array, turned_mounts

OFFSET_SIGMA_RAD: Final = math.radians(0.5)
ODOMETER_SIGMA: Final = 0.03
TURN_SIGMA: Final = 0.01
RANGE_SIGMA: Final = 0.01
"""Standard deviations of the slow states at the start."""
HEADING_WALK: Final = math.radians(1.0) ** 2
"""Variance of the heading by odometry, rad²/m: the value at the start, …"""
HEADING_WALK_MIN: Final = math.radians(0.1) ** 2
WALK_WINDOW_M: Final = 0.5
WALK_PRIOR: Final = 4
WALK_MEMORY: Final = 0.06
"""… its least value, the way after which it is renewed, how many renewals the first value is worth, and the least
share of one renewal."""
PLACE_WALK: Final = 0.002**2
"""Variance of a displacement by odometry on each axis, m²/m."""
SLIP_SHARE: Final = 0.4
"""With fewer of the expected echoes than this, the wheels may have slipped: odometry is then trusted less."""
FAILURES_DOUBTED: Final = 2
LANDMARKS_DOUBTED: Final = 2
"""So many failures in succession of so many landmarks at once let the pose be doubted."""
RENEWED_SHARE: Final = 0.7
"""Share of the expected echoes that is assumed after a displacement was found."""
SLIP_M: Final = 0.02
SLIP_RAD: Final = math.radians(1.0)
"""Standard deviations that each firing adds then."""
RANGE_NOISE: Final = 0.01
RANGE_NOISE_M: Final = 0.001
"""Nominal noise of a range: a share of it, and one that does not depend on it; the filter estimates the true one."""

POSE: Final = 4
"""Numbers of a waiting firing before its ranges: the pose of the base, and the ring's direction."""
TURNED_RAD: Final = 1e-9
"""A ring that turns otherwise than the wheels, by more than this, is one of a synchro drive."""


class LandmarkTracker:
    """The landmark filter of one drive.

    A firing is a row of numbers: the pose of the base by odometry (m, rad), the ring's direction (rad), and the range
    of each sensor (m).

    Parameters
    ----------
    ring : RingConfig
        The sensors.

    Attributes
    ----------
    e : (1,) Estimate
        The mean.
    covariance : (ROWS_MAX, ROWS_MAX) float
        Of the errors that `perception.localization.landmark_state` defines.
    entered : int
        Firings entered.
    entered_at : (POSE,) float
        Odometry at the last of them.
    """

    SCRATCH: Final = ("e",)
    """A view of the same memory, left out of snapshots."""

    def __init__(self, ring: RingConfig) -> None:
        self._mounts, self._turning = mounts_array(ring.mounts), ring.turning
        half_step_m = 0.5 * ring.resolution_m
        self._ring = np.array([
            half_step_m**2 / 3.0 + RANGE_NOISE_M**2, RANGE_NOISE**2, math.radians(ring.beam_half_angle_deg),
            ring.range_min_m + half_step_m, ring.range_max_m,
        ])  # fmt: skip
        """What `update_with_firing` takes after the pose."""
        self.estimate = zeros(Estimate, 1)
        self.e = records(Estimate, self.estimate)
        self.covariance = np.zeros((ROWS_MAX, ROWS_MAX))
        self.entered_at = np.zeros(POSE)
        self.reset()

    def reset(self) -> None:
        """Start again with the next firing."""
        self.estimate.view(np.uint8)[...] = 0
        self.covariance[...] = 0.0
        slow = (OFFSET, OFFSET_SIGMA_RAD), (ODOMETER, ODOMETER_SIGMA), (TURN, TURN_SIGMA), (RANGE, RANGE_SIGMA)
        for row, sigma in slow:
            self.covariance[row, row] = sigma**2
        e = self.e[0]
        e.odometer_scale = e.range_scale = e.noise = e.fit_share = 1.0
        self.entered = 0
        self.is_synchro = False
        self._walk = HEADING_WALK
        self._windows = 0
        self._window_m = 0.0
        self._window_variance = -1.0

    @property
    def heading_walk(self) -> float:
        """The estimated random walk of the heading by odometry, rad per √m."""
        return math.sqrt(self._walk)

    @property
    def range_max_m(self) -> float:
        """Greatest range of the ring, m."""
        return float(self._ring[-1])

    def assume_walk_of(self, other: LandmarkTracker) -> None:
        """Begin with the random walk of the heading that another filter of the same drive found."""
        self._walk, self._windows = other._walk, other._windows

    def landmarks(self, *names: str) -> list[list[Any]]:
        """Return fields of all landmarks as lists of numbers."""
        landmarks = self.estimate["landmarks"][0, : int(self.estimate["count"][0])]
        return [landmarks[name].tolist() for name in names]

    def enter(self, row: Floats) -> None:
        """Move to a firing, the first of which gives the pose, and enter its ranges."""
        x, y, theta, yaw = row[:POSE].tolist()
        e = self.e[0]
        if self.entered == 0:
            e.x, e.y, e.heading = x, y, yaw
        else:
            self._move(x, y, theta, yaw)
        self.entered_at[:] = x, y, theta, yaw
        self.entered += 1
        mounts = turned_mounts(self._mounts, self._turning, theta - yaw)
        update_with_firing(self.e, self.covariance, mounts, row[POSE:], x, y, yaw, *self._ring.tolist())

    @property
    def is_doubtful(self) -> bool:
        """Whether several landmarks fail at once, or hardly any echo comes: rather a robot that slipped."""
        failing = self.estimate["landmarks"]["failures"][0, : int(self.estimate["count"][0])] >= FAILURES_DOUBTED
        return bool(np.count_nonzero(failing) >= LANDMARKS_DOUBTED or self.e[0].fit_share < SLIP_SHARE)

    def displace(self, by: Pose, covariance: Floats) -> None:
        """Move the ring without odometry.

        Parameters
        ----------
        by : Pose
            Its true pose as seen from the believed one.
        covariance : (3, 3) float
            Of that: x, y (m) and turn (rad).
        """
        e = self.e[0]
        c, s = math.cos(e.heading), math.sin(e.heading)
        e.x, e.y, e.heading = e.x + c * by.x - s * by.y, e.y + s * by.x + c * by.y, e.heading + by.theta
        n = rows_used(self.e)
        write_lever(self.e, e.lever)
        to = np.zeros((n, 3))
        to[X, 0], to[X, 1], to[Y, 0], to[Y, 1] = c, -s, s, c
        to[:, 2] = self.estimate["lever"][0, :n]
        self.covariance[:n, :n] += to @ covariance @ to.T
        for i in range(e.count):
            e.landmarks[i].failures = 0
        e.fit_share = max(e.fit_share, RENEWED_SHARE)
        self._window_variance, self._window_m = -1.0, 0.0
        e.offset_correction = e.heading_correction = 0.0

    def _move(self, x: float, y: float, theta: float, yaw: float) -> None:
        """Follow odometry to a position (m), a direction of travel and a direction of the ring (rad)."""
        x_before, y_before, theta_before, yaw_before = self.entered_at.tolist()
        c, s = math.cos(theta_before), math.sin(theta_before)
        dx, dy = x - x_before, y - y_before
        ring_turn, travel_turn = wrap_angle(yaw - yaw_before), wrap_angle(theta - theta_before)  # a log may wrap them
        self.is_synchro = self.is_synchro or abs(wrap_angle(travel_turn - ring_turn)) > TURNED_RAD
        way = math.hypot(dx, dy)
        self._renew_walk(way)
        turn_variance, place_variance = self._walk * way, PLACE_WALK * way
        slip_m2 = slip_rad2 = 0.0
        if self.e[0].fit_share < SLIP_SHARE:
            slip_m2, slip_rad2 = SLIP_M**2, SLIP_RAD**2
        propagate(
            self.e, self.covariance, c * dx + s * dy, c * dy - s * dx, theta_before - yaw_before, ring_turn,
            travel_turn, (0.0 if self.is_synchro else turn_variance) + slip_rad2,
            turn_variance if self.is_synchro else 0.0, place_variance + slip_m2,
        )  # fmt: skip

    def _renew_walk(self, way: float) -> None:
        """Estimate the random walk of the heading from the filter's corrections.

        Corrections of a consistent filter are uncorrelated: over a way w their sum has the variance
        P(start) + q w − P(end) (after K. Myers and B. Tapley, "Adaptive sequential estimation with unknown noise
        statistics", 1976).
        """
        self._window_m += way
        if self._window_m < WALK_WINDOW_M:
            return
        e, row = self.e[0], OFFSET if self.is_synchro else HEADING
        seen = e.offset_correction if self.is_synchro else e.heading_correction
        variance = float(self.covariance[row, row])
        if self._window_variance >= 0.0 and e.count >= 2:
            found = (seen * seen + variance - self._window_variance) / self._window_m
            self._windows += 1
            share = max(WALK_MEMORY, 1.0 / (self._windows + WALK_PRIOR))
            self._walk = max(HEADING_WALK_MIN, self._walk + share * (found - self._walk))
        self._window_m, self._window_variance = 0.0, variance
        e.offset_correction = e.heading_correction = 0.0
