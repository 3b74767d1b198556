"""Whether a body of another outline, or of another radius, explains a circle's readings better than the circle does.

A box or a three-sided piece of a drum's size is none of the alternatives that are fitted. What they have in common is
that their surface deviates from the circle's by centimetres, smoothly over the bearing. So the unknown outline is a
Gaussian process about the circle, and its lead follows in closed form from the mean errors of the bearings
(Rasmussen and Williams, *Gaussian Processes for Machine Learning*, 2006, eq. 2.30). A round body whose radius lies
between a model's and a rival's is worse than the model by a few centimetres only, as the rival is, and the prior
would decide; its radius is therefore an unknown of its own, with the same closed form.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.inference.cross_path import is_crossed
from perception.bayes.inference.likelihood import bounded_exp
from perception.bayes.inference.noise_estimation import noise_variance
from perception.bayes.memory.elements import BEARING_BINS, BIN_CAPACITY
from perception.bayes.memory.parameters import SYSTEMATIC_M
from perception.bayes.memory.scratch import BearingErrors
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import CircleTrack, StateRecord
from perception.kernel import kernel
from perception.shared_numbers import OUTLIER_SIGMAS

OUTLINE_SIGMA_M: Final = 0.05
"""Deviation of an unknown outline from a model's: that of boxes of its size."""
OUTLINE_SCALE_RAD: Final = 0.45
"""Bearing over which that deviation changes."""
OUTLINE_READINGS_MIN: Final = 3
"""Least readings of a bearing that counts, so that their median ignores an outlier."""
OUTLINE_BEARINGS_MIN: Final = 4
"""Least bearings: two of them are needed for the place, and a third has an outlier now and then."""
OTHER_RADIUS_SIGMA_M: Final = 0.2
"""Deviation of other round bodies' radii from a model's."""
OTHER_RADIUS_SAME_M: Final = 0.015
"""With a smaller deviation a radius is the model's own."""
OTHER_RADIUS_ERROR_M: Final = 0.04
"""Greatest standard deviation at which a radius is compared; before that the rivals suffice."""
BIN_RAD: Final = math.tau / BEARING_BINS
"""Bearing between two bins of a track's reservoir."""
DETERMINANT_MIN: Final = 1e-9
"""Least determinant of the centre's information, as a share of its diagonal: with less there is one bearing only."""


@kernel
def sort_errors(s: StateRecord, p: SettingsRecord, track: CircleTrack, n: int) -> None:
    """Write the errors of the readings that a circle answers to the scratch's `bearings`, ascending.

    A circle nearer than the ring's shortest range does not count: every such range is the shortest one.

    Parameters
    ----------
    s, p, track
        Memory, of which the first `n` readings of the scratch count and `own` holds what the circle predicts,
        settings, and the circle.
    n : int
        Readings.
    """
    scratch = s[0].scratch
    var0, rel2 = noise_variance(s, p)
    for b in range(BEARING_BINS):
        scratch.bearings[b].count = 0
        scratch.bearings[b].variance = 0.0
    own = scratch.own
    for j in range(n):
        q = scratch.readings[j]
        e = own.error[j]
        if abs(e) > p[0].gate_m or q.range_m - e < p[0].range_min_m:
            continue
        if own.ahead[j] < p[0].cos_half_angle * own.distance[j]:
            continue
        dx = track.x - q.x
        dy = track.y - q.y
        per_slope = 1.0
        if own.rays > 0 and not is_crossed(q):  # the deviation of the surface, where the ray meets it
            dx, dy = own.slope_x[j], own.slope_y[j]
            per_slope = 1.0 / math.sqrt(dx * dx + dy * dy)
        e *= per_slope
        bearing = scratch.bearings[int((math.atan2(dy, dx) / (2.0 * math.pi) + 0.5) * BEARING_BINS) % BEARING_BINS]
        k = bearing.count
        if k == BIN_CAPACITY:
            continue
        while k > 0 and bearing.errors[k - 1] > e:
            bearing.errors[k] = bearing.errors[k - 1]
            k -= 1
        bearing.errors[k] = e
        bearing.count += 1
        bearing.variance += (var0 + rel2 * q.range_m * q.range_m) * per_slope * per_slope


@kernel
def average_errors(bearing: BearingErrors) -> None:
    """Write the mean of a bearing's errors (m) and its accuracy, the inverse of that mean's standard deviation (1/m).

    It needs the errors and the sum of their variances, of `sort_errors`. An error farther from the median than
    `OUTLIER_SIGMAS` counts as that far. With fewer than `OUTLINE_READINGS_MIN` errors the accuracy is 0 and
    the mean is not written.
    """
    n = bearing.count
    bearing.accuracy = 0.0
    if n < OUTLINE_READINGS_MIN:
        return
    variance = bearing.variance / n
    median = 0.5 * (bearing.errors[(n - 1) // 2] + bearing.errors[n // 2])
    most = OUTLIER_SIGMAS * math.sqrt(variance)
    total = 0.0
    for k in range(n):
        total += min(most, max(-most, bearing.errors[k] - median))
    bearing.mean = median + total / n
    bearing.accuracy = 1.0 / math.sqrt(variance / n + SYSTEMATIC_M**2)


@kernel
def outline_lead(s: StateRecord, p: SettingsRecord, track: CircleTrack, n: int) -> float:
    """Return the lead (nat) of an unknown outline over a circle; 0 where it was heard from too few bearings.

    With m the mean errors of the bearings, D their variances and K their covariance under the process::

        lead = log N(m; 0, K + D) − log N(m; 0, D)

    Both are divided by D, so that a bearing without readings has accuracy 0 and changes nothing; a Cholesky root of
    I + D⁻½ K D⁻½, a row at a time, then gives the determinant and the whitened means.

    Parameters
    ----------
    s, p, track, n
        As for `sort_errors`.
    """
    scratch = s[0].scratch
    bearings, root = scratch.bearings, scratch.outline_root
    sort_errors(s, p, track, n)
    heard = 0
    lead = 0.0
    for b in range(BEARING_BINS):
        here = bearings[b]
        average_errors(here)
        if here.accuracy == 0.0:
            continue
        heard += 1
        error = here.mean * here.accuracy
        whitened = error
        diagonal = 1.0 + (OUTLINE_SIGMA_M * here.accuracy) ** 2
        for k in range(b):
            there = bearings[k]
            root[b, k] = 0.0
            if there.accuracy == 0.0:
                continue
            alike = math.exp((math.cos((b - k) * BIN_RAD) - 1.0) / OUTLINE_SCALE_RAD**2)
            v = OUTLINE_SIGMA_M**2 * alike * here.accuracy * there.accuracy
            for i in range(k):
                v -= root[b, i] * root[k, i]
            v /= root[k, k]
            root[b, k] = v
            diagonal -= v * v
            whitened -= v * there.whitened
        root[b, b] = math.sqrt(diagonal)
        here.whitened = whitened / root[b, b]
        lead += 0.5 * (error * error - here.whitened**2) - math.log(root[b, b])
    return lead if heard >= OUTLINE_BEARINGS_MIN else 0.0


@kernel
def round_lead(s: StateRecord, p: SettingsRecord, n: int) -> float:
    """Return the lead (nat) of a circle of unknown radius over a circle; 0 where the radius is too uncertain.

    A step of least squares on the errors gives the change δ of the radius, with the centre free, and its variance v;
    with w the variance of other radii about the circle's::

        lead = log N(δ; 0, v + w) − log N(δ; 0, v)

    Parameters
    ----------
    s, p, n
        As for `sort_errors`.
    """
    var0, rel2 = noise_variance(s, p)
    xx = xy = yy = xr = yr = rr = xe = ye = re = 0.0
    own = s[0].scratch.own
    for j in range(n):
        q = s[0].scratch.readings[j]
        e = own.error[j]
        if abs(e) > p[0].gate_m or q.range_m - e < p[0].range_min_m:
            continue
        if own.ahead[j] < p[0].cos_half_angle * own.distance[j]:
            continue
        variance = var0 + rel2 * q.range_m * q.range_m
        most = OUTLIER_SIGMAS * math.sqrt(variance)
        e = min(most, max(-most, e))
        ux, uy = own.slope_x[j], own.slope_y[j]
        is_slant = is_crossed(q) or own.rays > 0
        along = math.sqrt(ux * ux + uy * uy) if is_slant else 1.0  # fall of the range with the radius
        xx += ux * ux / variance
        xy += ux * uy / variance
        yy += uy * uy / variance
        xr -= along * ux / variance
        yr -= along * uy / variance
        rr += along * along / variance
        xe += ux * e / variance
        ye += uy * e / variance
        re -= along * e / variance
    det = xx * yy - xy * xy
    if det <= DETERMINANT_MIN * xx * yy:
        return 0.0
    # What the centre explains of the radius, and of the errors.
    ax = (yy * xr - xy * yr) / det
    ay = (xx * yr - xy * xr) / det
    information = rr - ax * xr - ay * yr
    if information <= 0.0:
        return 0.0
    change = (re - ax * xe - ay * ye) / information
    v = 1.0 / information + OTHER_RADIUS_SAME_M**2
    if v > OTHER_RADIUS_ERROR_M**2:
        return 0.0
    w = OTHER_RADIUS_SIGMA_M**2
    return 0.5 * (change * change * w / (v * (v + w)) - math.log(1.0 + w / v))


@kernel
def other_bodies(track: CircleTrack, p: SettingsRecord) -> float:
    """Return the weight, relative to a model, of the bodies that are no alternative: other outlines, other radii.

    The rivals are other radii, too, so that these weigh only as far as they exceed the rivals together.
    """
    total = bounded_exp(track.outline_lead - p[0].model_prior_nat) if track.outline_lead != 0.0 else 0.0
    if track.round_lead > 0.0:
        more = bounded_exp(track.round_lead - p[0].model_prior_nat)
        for k in range(p[0].model_count, p[0].circle_count):
            if track.leads[k] != 0.0:
                more -= bounded_exp(track.leads[k] - p[0].model_prior_nat)
        total += max(0.0, more)
    return total
