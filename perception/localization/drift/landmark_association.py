"""Which landmark of the drift filter a range is from, and which one should have been heard.

A landmark is expected in a beam by the estimate; its bearing and range have the variance that the covariance gives.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

from perception.kernel import Floats, kernel
from perception.localization.drift.landmark_filter import innovation_variance, rows_used
from perception.localization.drift.landmark_state import FIRST, EstimateRecord, SonarModel, X, Y
from perception.shared_numbers import NO_INDEX

GATE: Final = 10.8
"""χ² of one degree of freedom that a true reading exceeds in one of a thousand cases."""
OWN_M: Final = 0.15
"""A range farther than this from a landmark's is of something else, however uncertain the landmark is."""
MARGIN_RAD: Final = math.radians(1.0)
MARGIN_SIGMAS: Final = 3.0
"""This far inside the beam a landmark must answer, and this far outside it may: a fixed part, and standard deviations
of its bearing."""
HIDING_RADII: Final = 1.1
"""A line of sight this near to a landmark's centre is hidden by it."""

Beam: TypeAlias = tuple[float, float, float, float]
"""Place x, y of a sensor (m) and direction of its axis (unit vector x, y), by the estimate."""


@kernel
def bearing_variance(covariance: Floats, i: int, dx: float, dy: float) -> float:
    """Return the variance of the bearing of landmark `i`, at (dx, dy) m from a sensor, relative to the ring, rad²."""
    row = FIRST + 2 * i
    u, v, d2 = -dy, dx, dx * dx + dy * dy
    xx = covariance[row, row] - 2.0 * covariance[row, X] + covariance[X, X]
    xy = covariance[row, row + 1] - covariance[row, Y] - covariance[X, row + 1] + covariance[X, Y]
    yy = covariance[row + 1, row + 1] - 2.0 * covariance[row + 1, Y] + covariance[Y, Y]
    variance: float = (u * u * xx + 2.0 * u * v * xy + v * v * yy) / (d2 * d2)
    return variance


@kernel
def is_landmark_hidden(e: EstimateRecord, i: int, x: float, y: float) -> bool:
    """Return whether another landmark stands between a sensor at (x, y) (m) and the centre of landmark `i`."""
    est = e[0]
    dx, dy = est.landmarks[i].x - x, est.landmarks[i].y - y
    d = math.sqrt(dx * dx + dy * dy)
    for k in range(est.count):
        other = est.landmarks[k]
        ox, oy = other.x - x, other.y - y
        along = (ox * dx + oy * dy) / d
        if k != i and 0.0 < along < d and abs(ox * dy - oy * dx) < HIDING_RADII * other.radius * d:
            return True
    return False


@kernel
def may_answer_instead(
    e: EstimateRecord, i: int, x: float, y: float, ax: float, ay: float, half_angle: float, r: float
) -> bool:
    """Return whether a range may be of another landmark than `i`, of which any visible part is in the beam.

    Where drums answer with any part that is in the beam, the nearest point of one whose centre is outside is farther
    than that of the drum, by up to the distance of its horizon.

    Parameters
    ----------
    e : (1,) Estimate
        The mean.
    i : int
        The landmark.
    x, y : float
        The sensor's place, m.
    ax, ay : float
        Direction of its axis.
    half_angle : float
        Half the beam's width, rad.
    r : float
        Range, m.
    """
    est = e[0]
    for k in range(est.count):
        other = est.landmarks[k]
        dx, dy = other.x - x, other.y - y
        d = math.sqrt(dx * dx + dy * dy)
        if k == i or d <= other.radius:
            continue
        off = abs(math.atan2(ax * dy - ay * dx, ax * dx + ay * dy))
        horizon = math.sqrt(d * d - other.radius * other.radius)
        if off < half_angle + math.asin(other.radius / d) + MARGIN_RAD and (
            d - other.radius - OWN_M < r / est.range_scale < horizon + OWN_M
        ):
            return True
    return False


@kernel
def associate(
    e: EstimateRecord, covariance: Floats, beam: Beam, r: float, sonar: SonarModel
) -> tuple[int, float, bool, int, float, bool]:
    """Return which landmark explains a range best, and which should be heard first.

    Parameters
    ----------
    e : (1,) Estimate
        The mean.
    covariance : (rows, rows) float
        Of it.
    beam : Beam
        Place and direction of the sensor.
    r : float
        Range, m; inf: no echo.
    sonar : SonarModel
        What is known of the sensors.

    Returns
    -------
    (int, float, bool)
        The landmark in the beam whose predicted range is nearest in standard deviations, or `NO_INDEX`; the square
        of that distance; whether another one explains the range, too.
    (int, float, bool)
        The landmark in the beam that is predicted nearest, its range (m), and whether it is surely in the beam.
    """
    x, y, ax, ay = beam
    est = e[0]
    n = rows_used(e)
    best = second = first = NO_INDEX
    best_nis = second_nis = GATE
    nearest = math.inf
    is_expected = False
    for i in range(est.count):
        landmark = est.landmarks[i]
        dx, dy = landmark.x - x, landmark.y - y
        d = math.sqrt(dx * dx + dy * dy)
        if d <= landmark.radius or dx * ax + dy * ay < 0.0:
            continue
        inside = sonar.half_angle - abs(math.atan2(ax * dy - ay * dx, ax * dx + ay * dy))
        margin = MARGIN_RAD + MARGIN_SIGMAS * math.sqrt(bearing_variance(covariance, i, dx, dy))
        if inside < -margin:
            continue
        predicted = est.range_scale * (d - landmark.radius)
        if predicted < nearest:
            nearest, first, is_expected = predicted, i, inside > margin
        if abs(r - predicted) > OWN_M:
            continue
        u, v = est.range_scale * dx / d, est.range_scale * dy / d
        variance = innovation_variance(covariance, n, FIRST + 2 * i, u, v, d - landmark.radius, est.gain)
        nis = (r - predicted) ** 2 / (variance + est.noise * (sonar.var0 + sonar.rel2 * predicted * predicted))
        if nis < best_nis:
            second, second_nis = best, best_nis
            best, best_nis = i, nis
        elif nis < second_nis:
            second, second_nis = i, nis
    return best, best_nis, second != NO_INDEX, first, nearest, is_expected
