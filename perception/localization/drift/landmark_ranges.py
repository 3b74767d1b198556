"""Ranges as measurements of the landmark filter: which landmark each is from, gates, and the corrections.

A reading is entered at once and only once, so the evidence of two readings is independent. Perception's own
estimates, which average many readings at poses taken as exact, enter only as the first guess of a landmark's place.
"""

from __future__ import annotations

import math
from typing import Final

from perception.kernel import Floats, kernel
from perception.localization.drift.landmark_association import (
    associate,
    bearing_variance,
    is_landmark_hidden,
    may_answer_instead,
)
from perception.localization.drift.landmark_filter import correct, innovation_variance, rows_used
from perception.localization.drift.landmark_state import (
    FIRST,
    STRAY_MAX,
    STRAY_MIN,
    EstimateRecord,
    LastUse,
    SonarModel,
)
from perception.sensor_mounts import RingPose, SensorPose
from perception.shared_numbers import NO_INDEX, PASSED_M, SPACING_M

SOFT: Final = 6.25
"""Normalised squared innovation from which on a reading's weight is reduced: its tails are heavier than a bell's."""
NEAR_M: Final = 0.5
"""A range this near to a landmark's, but outside the gate, is a failure of that landmark."""
FRESH_RAD: Final = math.radians(1.0)
"""A sensor's readings from poses nearer than `SPACING_M`, and turned by less than this, repeat one error of rounding;
only the first is used."""
NOISE_MEMORY: Final = 0.005
"""Share of one reading in the estimate of the noise."""
NOISE_MIN: Final = 0.02
"""Least estimate of the noise, as a factor on the nominal variance."""
NOISE_MAX: Final = 25.0
"""Greatest estimate of the noise, as a factor on the nominal variance."""
FIT_MEMORY: Final = 0.03
"""Share of one expected echo in `Estimate.fit_share`."""
NO_RANGE: Final = -1.0
"""In place of the range of a landmark that was not heard, m."""
EDGE_RAD: Final = math.radians(0.2)
"""Standard deviation of where a beam ends."""
EDGE_SIGMAS: Final = 3.0
"""That a landmark so far inside was heard, or one so far outside was not, says nothing about its bearing."""
DROP_OUT: Final = 0.08
"""Share of the expected echoes that a sensor misses."""
STRAY: Final = 0.02
"""Share of the landmarks outside a beam that are heard, at first: of mirrors none is, many are where a drum answers
with any part that is in the beam."""
STRAY_MEMORY: Final = 0.03
"""Weight of one look in that share."""
WILD_PER_M: Final = 0.01
"""Share of the readings that are of something else, for each metre of range: as many fit a landmark by chance."""
CURVATURE_MIN: Final = 1e-6
"""With less, as a share of the squared slope, nothing would change."""


@kernel
def has_moved_since(last: LastUse, x: float, y: float, axis: float) -> bool:
    """Return whether a sensor at (x, y) (m), axis (rad), has moved or turned enough since its last reading."""
    return last.is_known == 0 or abs(axis - last.axis) >= FRESH_RAD or math.hypot(x - last.x, y - last.y) >= SPACING_M


@kernel
def has_moved(e: EstimateRecord, i: int, x: float, y: float, axis: float) -> bool:
    """Return whether a sensor has moved or turned enough since its last reading that was used; note its place.

    Parameters
    ----------
    e : (1,) Estimate
        Updated.
    i : int
        The sensor.
    x, y, axis : float
        Its place (m) and direction (rad) by odometry.
    """
    last = e[0].sensors[i]
    if not has_moved_since(last, x, y, axis):
        return False
    last.x, last.y, last.axis, last.is_known = x, y, axis, 1
    return True


@kernel
def learn_stray(e: EstimateRecord, inside: float, chance: float) -> None:
    """Renew the share of landmarks outside a beam that are heard, by one look, as far as that landmark was outside.

    Parameters
    ----------
    e : (1,) Estimate
        Updated.
    inside : float
        Probability that the landmark is inside the beam, before the look.
    chance : float
        As for `update_with_edge`.
    """
    est = e[0]
    outside = 1.0 - inside
    if chance < 0.0:
        heard, as_outside, as_inside = 0.0, (1.0 - est.stray) * outside, DROP_OUT * inside
    else:
        heard, as_outside, as_inside = 1.0, est.stray * outside, inside + chance
    weight = STRAY_MEMORY * as_outside / (as_outside + as_inside)
    est.stray = min(STRAY_MAX, max(STRAY_MIN, est.stray + weight * (heard - est.stray)))


@kernel
def update_with_edge(
    e: EstimateRecord,
    covariance: Floats,
    i: int,
    mx: float,
    my: float,
    axis: float,
    half_angle: float,
    chance: float,
) -> None:
    """Enter that a sensor heard a landmark, which is inside the beam, or did not, so that it is rather outside.

    With t the angle from the landmark to the nearer edge of the beam, positive inside, and q² the sum of its variance
    and the edge's, an echo has the probability Φ(t/q); the posterior's moments are those of the probit model (C. E.
    Rasmussen and C. K. I. Williams, "Gaussian Processes for Machine Learning", 2006, 3.9). Ranges hardly depend on
    the heading, but what is heard by which sensor does.

    A wild reading that only seems to be of the landmark is as probable wherever the landmark is. The worse the range
    fits, the more it may be one. Nor does an echo say much where landmarks are heard from outside.

    Parameters
    ----------
    e : (1,) Estimate
        Updated.
    covariance : (rows, rows) float
        Updated.
    i : int
        The landmark.
    mx, my, axis : float
        The sensor's mount in the ring's frame, m and rad.
    half_angle : float
        Half the beam's width, rad.
    chance : float
        Probability of the reading as a wild one over that as an echo of the landmark inside the beam; negative: the
        sensor did not hear the landmark.
    """
    est = e[0]
    c, s = math.cos(est.heading), math.sin(est.heading)
    dx = est.landmarks[i].x - (est.x + c * mx - s * my)
    dy = est.landmarks[i].y - (est.y + s * mx + c * my)
    ax, ay = math.cos(est.heading + axis), math.sin(est.heading + axis)
    d = math.sqrt(dx * dx + dy * dy)
    off = math.atan2(ax * dy - ay * dx, ax * dx + ay * dy)
    side = 1.0 if off > 0.0 else -1.0
    t = half_angle - abs(off)
    if abs(t) > half_angle:
        return
    # t falls as the landmark moves along (-dy, dx) on the left side.
    u, v = side * dy / (d * d), -side * dx / (d * d)
    variance = innovation_variance(covariance, rows_used(e), FIRST + 2 * i, u, v, 0.0, est.gain)
    q = math.sqrt(variance + EDGE_RAD * EDGE_RAD)
    z = t / q
    inside = 0.5 * math.erfc(-z / math.sqrt(2.0))
    # The reading has the probability `rest` + `share` Φ, but for a constant factor.
    if chance < 0.0:
        share = (DROP_OUT - 1.0) * (1.0 - est.stray)
        rest = 1.0 + (DROP_OUT - 1.0) * est.stray
    else:
        share, rest = 1.0 - est.stray, est.stray + chance
    learn_stray(e, inside, chance)
    if (z < -EDGE_SIGMAS) if chance < 0.0 else (z > EDGE_SIGMAS):
        return
    density = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    slope = share * density / ((rest + share * inside) * q)
    curvature = -slope * z / q - slope * slope
    if abs(curvature) > CURVATURE_MIN * slope * slope:
        # The posterior's mean is t + σ² slope, its variance σ² + σ⁴ curvature: more where both causes are as likely.
        correct(e, covariance, -slope / curvature, -1.0 / curvature)


@kernel
def correct_with_range(
    e: EstimateRecord, covariance: Floats, best: int, best_nis: float, mount: SensorPose, r: float, sonar: SonarModel
) -> None:
    """Correct the estimate with a range that one landmark explains, and learn the ranges' noise from it.

    Parameters
    ----------
    best, best_nis
        The landmark, and the square of its distance in standard deviations, as of `associate`.
    e, covariance, mount, r, sonar
        As for `update_with_range`.
    """
    mx, my, axis = mount
    est = e[0]
    c, s = math.cos(est.heading), math.sin(est.heading)
    x = est.x + c * mx - s * my
    y = est.y + s * mx + c * my
    landmark = est.landmarks[best]
    dx, dy = landmark.x - x, landmark.y - y
    d = math.sqrt(dx * dx + dy * dy)
    u, v = est.range_scale * dx / d, est.range_scale * dy / d
    # The mean distance is longer than that of the means, by what lies across the line of sight.
    longer = 0.5 * d * bearing_variance(covariance, best, dx, dy)
    predicted = est.range_scale * (d + longer - landmark.radius)
    innovation = r - predicted
    variance = innovation_variance(covariance, rows_used(e), FIRST + 2 * best, u, v, d - landmark.radius, est.gain)
    nominal = sonar.var0 + sonar.rel2 * predicted * predicted
    noise = est.noise * nominal
    if best_nis > SOFT:
        noise *= math.sqrt(best_nis / SOFT)
    correct(e, covariance, innovation, variance + noise)
    seen = (innovation * innovation - variance) / nominal
    # Of a landmark at a place that is hardly known, an innovation says nothing about the noise.
    weight = (noise / (variance + noise)) ** 2
    est.noise = min(NOISE_MAX, max(NOISE_MIN, est.noise + NOISE_MEMORY * weight * (seen - est.noise)))
    landmark.failures = 0
    landmark.hits += 1
    total = variance + noise
    fits = math.exp(-0.5 * innovation * innovation / total) / math.sqrt(2.0 * math.pi * total)
    update_with_edge(e, covariance, best, mx, my, axis, sonar.half_angle, WILD_PER_M / fits)


@kernel
def update_with_range(
    e: EstimateRecord,
    covariance: Floats,
    mount: SensorPose,
    r: float,
    sonar: SonarModel,
) -> int:
    """Enter the range of one sensor; return the landmark that it is from, or `NO_INDEX`.

    The reading is from the landmark in the beam whose predicted range is nearest in standard deviations. Where two
    explain it, it is not used. A range that passed a landmark which should have answered moves that out of the beam;
    one that misses it by less than `NEAR_M` is a failure of it. Each expected echo enters `fit_share`.

    Parameters
    ----------
    e : (1,) Estimate
        Updated.
    covariance : (rows, rows) float
        Updated.
    mount : SensorPose
        The sensor's mount in the ring's frame, m and rad.
    r : float
        Range, m, below the greatest one; inf: no echo.
    sonar : SonarModel
        What is known of the sensors.
    """
    mx, my, axis = mount
    half_angle = sonar.half_angle
    est = e[0]
    c, s = math.cos(est.heading), math.sin(est.heading)
    x, y = est.x + c * mx - s * my, est.y + s * mx + c * my
    ax, ay = math.cos(est.heading + axis), math.sin(est.heading + axis)
    best, best_nis, is_ambiguous, first, nearest, is_expected = associate(e, covariance, (x, y, ax, ay), r, sonar)
    if (
        is_expected
        and best == NO_INDEX
        and (r < nearest - NEAR_M or may_answer_instead(e, first, x, y, ax, ay, half_angle, r))
    ):
        is_expected = False
    if is_expected:
        est.fit_share += FIT_MEMORY * ((1.0 if best != NO_INDEX else 0.0) - est.fit_share)
    is_missed = first != NO_INDEX and first != best and r > nearest + PASSED_M and nearest < sonar.range_max
    if is_missed and not is_landmark_hidden(e, first, x, y):
        update_with_edge(e, covariance, first, mx, my, axis, half_angle, NO_RANGE)
    elif best == NO_INDEX and is_expected and abs(r - nearest) <= NEAR_M:
        est.landmarks[first].failures += 1
    if best == NO_INDEX or is_ambiguous:
        return NO_INDEX
    correct_with_range(e, covariance, best, best_nis, mount, r, sonar)
    return best


@kernel
def update_with_firing(
    e: EstimateRecord, covariance: Floats, mounts: Floats, ranges: Floats, pose: RingPose, sonar: SonarModel
) -> int:
    """Enter the ranges of a firing; return how many were used.

    Parameters
    ----------
    e : (1,) Estimate
        Updated.
    covariance : (rows, rows) float
        Updated.
    mounts : (n, 3) float
        x, y (m), direction (rad) of each sensor in the ring's frame.
    ranges : (n,) float
        m; NaN: the sensor did not fire, inf: no echo.
    pose : RingPose
        The ring's by odometry, m and rad.
    sonar : SonarModel
        What is known of the sensors; a range at either end is no measurement.
    """
    px, py, yaw = pose
    used = 0
    c, s = math.cos(yaw), math.sin(yaw)
    for i in range(len(ranges)):
        r = ranges[i]
        if not r > sonar.range_min or e[0].count == 0:  # also true for NaN
            continue
        mx, my, axis = mounts[i, 0], mounts[i, 1], mounts[i, 2]
        if not has_moved(e, i, px + c * mx - s * my, py + s * mx + c * my, yaw + axis):
            continue
        if r >= sonar.range_max:
            r = math.inf
        if update_with_range(e, covariance, (mx, my, axis), r, sonar) != NO_INDEX:
            used += 1
    return used
