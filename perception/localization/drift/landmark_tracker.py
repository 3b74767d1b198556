"""The landmark filter along a drive: it follows odometry, enters firings, and learns how far the heading wanders."""

from __future__ import annotations

import math
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from config.robot import RingConfig
from drivers.messages import Pose, wrap_angle
from perception.bounds import CONSTANT, COUNT, FINITE, PLACE, bounds
from perception.kernel import Floats
from perception.localization.drift.landmark_filter import propagate, rows_used, write_lever
from perception.localization.drift.landmark_ranges import STRAY, update_with_firing
from perception.localization.drift.landmark_state import (
    FIRST,
    ODOMETER,
    OFFSET,
    RANGE,
    ROWS_MAX,
    TURN,
    Estimate,
    SonarModel,
    X,
    Y,
)
from perception.localization.drift.walk_rates import WalkRates
from perception.records import records, zeros
from perception.sensor_mounts import RingPose, mounts_array, turned_mounts
from perception.shared_numbers import ODOMETER_SIGMA, ROUNDING

OFFSET_SIGMA_RAD: Final = math.radians(0.5)
TURN_SIGMA: Final = 0.01
"""Standard deviation of the scale of turns, and of that of ranges, at the start."""
HEADING_RATES: Final = (math.radians(0.1) * 2.0 ** (0.5 * np.arange(12.0))) ** 2
"""Variances of the heading by odometry, rad²/m, from .1 to 4.5 °/√m."""
HEADING_PRIOR: Final = HEADING_RATES**-0.25
"""Weights of these variances before a drive, which let the filter begin with about 1 °/√m."""
WALK_WINDOW_M: Final = 0.25
"""The way after which the rates are weighed again."""
DRIFT_PLACE_WALK: Final = 0.0005**2
"""Variance of a displacement by odometry on each axis, m²/m. A base's distance errs by its scale, which the filter
finds, and where wheels slip; what is left is below what the echoes show."""
SLIP_SHARE: Final = 0.4
"""With fewer of the expected echoes than this, the wheels may have slipped: odometry is then trusted less."""
FAILURES_DOUBTED: Final = 2
"""Failures in succession of a landmark by which it lets the pose be doubted."""
LANDMARKS_DOUBTED: Final = 2
"""So many such landmarks at once let the pose be doubted."""
RENEWED_SHARE: Final = 0.7
"""Share of the expected echoes that is assumed after a displacement was found."""
FAILING_M: Final = 0.01
"""Standard deviation that each firing adds to the place while a landmark fails so often: a slip, if a small one."""
SLIP_M: Final = 0.02
"""Standard deviation that each firing adds to the place while the wheels may have slipped."""
SLIP_RAD: Final = math.radians(1.0)
"""Standard deviation that each firing adds to the heading then."""
RANGE_NOISE: Final = 0.01
"""Nominal noise of a range as a share of it; the filter estimates the true one."""
RANGE_NOISE_M: Final = 0.001
"""Part of that noise that does not depend on the range."""

POSE: Final = 4
"""Numbers of a waiting firing before its ranges: the pose of the base, and the ring's direction."""

Readings: TypeAlias = tuple[Floats, Floats, RingPose, SonarModel]
"""Mounts, ranges (m), the ring's pose by odometry (m, rad), and what is known of the sensors."""


class LandmarkTracker:
    """The landmark filter of one drive.

    A firing is a row of numbers: the pose of the base by odometry (m, rad), the ring's direction (rad), and the range
    of each sensor (m).

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    is_exact : bool
        Whether odometry is taken as exact: only landmarks and the ranges' scale are found then.

    Attributes
    ----------
    e : (1,) Estimate
        The mean.
    covariance : (ROWS_MAX, ROWS_MAX) float
        Of the errors that `perception.localization.drift.landmark_state` defines.
    entered : int
        Firings entered.
    entered_at : (POSE,) float
        Odometry at the last of them.
    """

    SCRATCH: Final = ("e", "_is_exact")
    """A view of the same memory, and a constant: left out of snapshots."""
    BOUNDS: Final = bounds(
        _mounts=CONSTANT,
        _ring=CONSTANT,
        estimate=Estimate.BOUNDS,
        covariance=FINITE,
        entered_at=PLACE,
        entered=COUNT,
        _window_m=FINITE,
        _window_variance=FINITE,
        _window_count=COUNT,
    )

    def __init__(self, ring: RingConfig, *, is_exact: bool = False) -> None:
        self._is_exact = is_exact
        self._mounts, self._turning = mounts_array(ring.mounts), ring.turning
        half_step_m = 0.5 * ring.resolution_m
        self._ring = np.array(
            [
                half_step_m**2 / 3.0 + RANGE_NOISE_M**2,
                RANGE_NOISE**2,
                math.radians(ring.beam_half_angle_deg),
                ring.range_min_m + half_step_m,
                ring.range_max_m,
            ]
        )
        """The numbers of a `SonarModel`."""
        self.estimate = zeros(Estimate, 1)
        self.e = records(Estimate, self.estimate)
        self.covariance = np.zeros((ROWS_MAX, ROWS_MAX))
        self.entered_at = np.zeros(POSE)
        self._rates = WalkRates(HEADING_RATES, HEADING_PRIOR)
        self.reset()

    def reset(self) -> None:
        """Start again with the next firing."""
        self.estimate.view(np.uint8)[...] = 0
        self.covariance[...] = 0.0
        slow = (OFFSET, OFFSET_SIGMA_RAD), (ODOMETER, ODOMETER_SIGMA), (TURN, TURN_SIGMA), (RANGE, TURN_SIGMA)
        for row, sigma in slow[-1:] if self._is_exact else slow:
            self.covariance[row, row] = sigma**2
        e = self.e[0]
        e.odometer_scale = e.range_scale = e.noise = e.fit_share = 1.0
        e.stray = STRAY
        self.entered = 0
        self.is_synchro = False
        self._rates.reset()
        self._window_m = 0.0
        self._window_variance = -1.0
        self._window_count = 0

    @property
    def heading_walk(self) -> float:
        """The estimated random walk of the heading by odometry, rad per √m."""
        return math.sqrt(self._rates.rate)

    @property
    def range_max_m(self) -> float:
        """Greatest range of the ring, m."""
        return float(self._ring[-1])

    def assume_walk_of(self, other: LandmarkTracker) -> None:
        """Begin with the random walk of the heading that another filter of the same drive found."""
        self._rates.assume(other._rates)

    def landmarks(self, *names: str) -> list[list[Any]]:
        """Return fields of all landmarks as lists of numbers."""
        landmarks = self.estimate["landmarks"][0, : int(self.estimate["count"][0])]
        return [landmarks[name].tolist() for name in names]

    def enter(self, row: Floats) -> None:
        """Move to a firing, the first of which gives the pose, and enter its ranges."""
        self.move(row)
        self.measure(row)

    def move(self, row: Floats) -> None:
        """Move to a firing, the first of which gives the pose."""
        x, y, theta, yaw = row[:POSE].tolist()
        e = self.e[0]
        if self.entered == 0 or self._is_exact:
            e.x, e.y, e.heading = x, y, yaw
        else:
            self._move(x, y, theta, yaw)
        self.entered_at[:] = x, y, theta, yaw
        self.entered += 1

    def measure(self, row: Floats) -> None:
        """Enter the ranges of a firing to which the filter has moved."""
        update_with_firing(self.e, self.covariance, *self.readings(row))

    def readings(self, row: Floats) -> Readings:
        """Return a firing as `perception.localization.drift.landmark_ranges.update_with_firing` takes it."""
        x, y, theta, yaw = row[:POSE].tolist()
        mounts = turned_mounts(self._mounts, self._turning, theta - yaw)
        return mounts, row[POSE:], (x, y, yaw), SonarModel(*self._ring.tolist())

    @property
    def is_doubtful(self) -> bool:
        """Whether several landmarks fail at once, or hardly any echo comes: rather a robot that slipped."""
        return bool(np.count_nonzero(self._failing()) >= LANDMARKS_DOUBTED or self.e[0].fit_share < SLIP_SHARE)

    def _failing(self) -> NDArray[np.bool_]:
        """Return which landmarks have failed so often that they, or the pose, are doubted."""
        failures: NDArray[np.int64] = self.estimate["landmarks"]["failures"][0, : int(self.estimate["count"][0])]
        return failures >= FAILURES_DOUBTED

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
        self.is_synchro = self.is_synchro or abs(wrap_angle(travel_turn - ring_turn)) > ROUNDING
        way = math.hypot(dx, dy)
        self._renew_walk(way)
        turn_variance, place_variance = self._rates.rate * way, DRIFT_PLACE_WALK * way
        slip_m2, slip_rad2 = FAILING_M**2 if np.any(self._failing()) else 0.0, 0.0
        if self.e[0].fit_share < SLIP_SHARE:
            slip_m2, slip_rad2 = SLIP_M**2, SLIP_RAD**2
        propagate(
            self.e,
            self.covariance,
            c * dx + s * dy,
            c * dy - s * dx,
            theta_before - yaw_before,
            ring_turn,
            travel_turn,
            (
                (0.0 if self.is_synchro else turn_variance) + slip_rad2,
                turn_variance if self.is_synchro else 0.0,
                place_variance + slip_m2,
            ),
        )

    def _renew_walk(self, way: float) -> None:
        """Weigh the rates of the heading's random walk by what the filter made of the last way."""
        self._window_m += way
        if self._window_m < WALK_WINDOW_M:
            return
        e = self.e[0]
        variance = self._heading_variance()
        if variance >= 0.0 and self._window_variance >= 0.0 and e.count == self._window_count:
            seen = e.offset_correction if self.is_synchro else e.heading_correction
            self._rates.enter(float(seen), self._window_variance, variance, self._window_m)
        else:
            self._rates.restart(max(variance, 0.0))
        self._window_m, self._window_variance, self._window_count = 0.0, variance, int(e.count)
        e.offset_correction = e.heading_correction = 0.0

    def _heading_variance(self) -> float:
        """Return the variance of the heading that wanders, rad²; −1 where the map cannot show it.

        It is the ring's against the map, of a synchro drive the wheels' against the ring.
        """
        if self.is_synchro:
            return float(self.covariance[OFFSET, OFFSET])
        if self.e[0].count < 2:
            return -1.0
        fit = fit_of_turn(np.column_stack(self.landmarks("x", "y")))
        end = FIRST + len(fit)
        return float(fit @ self.covariance[FIRST:end, FIRST:end] @ fit)


def fit_of_turn(landmarks: Floats) -> Floats:
    """Return the weights of the landmarks' errors in the best turn of them all against the ring.

    Parameters
    ----------
    landmarks : (count, 2) float
        Their places, m.

    Returns
    -------
    (2 count,) float
    """
    x, y = (landmarks - landmarks.mean(axis=0)).T
    fit: Floats = (np.column_stack([-y, x]) / np.sum(x * x + y * y)).ravel()
    return fit
