"""Predicted ranges of circles and lines, the evidence of raw ranges for them, and robust fits.

The true outline takes the place of the paper's chords here: an arc where the body is an arc, so that the chords'
inward bias is gone. A circle answers where the direction to its centre lies in the beam, with the distance less its
radius; a line where its normal does, with its perpendicular distance. A missing echo that was expected is evidence
against, as a hit is evidence for.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

from perception.bayes.inference.beam import GRAZING_MIN, ray_over_line
from perception.bayes.inference.cross_path import is_crossed, over_line
from perception.bayes.inference.likelihood import level_of, log_likelihood
from perception.bayes.inference.prediction import predict_circle
from perception.bayes.memory.elements import Reading
from perception.bayes.memory.parameters import (
    DROP_OUT_NAT,
    DROP_OUT_SHARE,
    FIT_DAMPING,
    FIT_STEP_MAX_GATES,
    FIT_STEP_MIN_GATES,
    FIT_TURN_MAX_RAD,
    FIT_TURN_MIN_RAD,
)
from perception.bayes.memory.scratch import CircleFit, LineFit, LineScore, Predictions, Score
from perception.bayes.memory.settings_record import Settings
from perception.kernel import kernel
from perception.records import Records
from perception.shared_numbers import FAR

NONE_YET: Final = 1e9
"""Initial least range and extent (m) of an object without a hit."""

NO_INFORMATION: Final = 1e-12
"""Information (in single perfect readings) that a fit starts from, to be regular without echoes."""


@kernel
def robust_weight(e: float, var: float, soft: float) -> float:
    """Return the Geman–McClure weight of a residual, 1/m²: its information, reduced for large residuals.

    1 / (v (1 + e²/(s v))²) is the Geman–McClure weight, with s the number of σ² at which it has fallen to a quarter.

    Parameters
    ----------
    e, var : float
        Residual (m) and its variance v (m²).
    soft : float
        s.
    """
    q = 1.0 / (1.0 + e * e / (soft * var))
    return q * q / var


@kernel
def score_circle(
    readings: Records[Reading],
    cx: float,
    cy: float,
    radius: float,
    p: Records[Settings],
    noise: int,
    predicted: Predictions,
    score: Score,
) -> None:
    """Score readings for a circle: write the log ratio to the background and the counts.

    ====================================  =====================================================================
    e = r − (distance to centre − ρ)      counts
    ====================================  =====================================================================
    |e| < gate, centre in the beam        the table's L(e); near the beam's edge only if that is positive
    e > gate, safely in the beam          `missed_echo_nat`: a drop-out; dearer where there are too many of them
    e < −gate, safely in the beam         `short_echo_nat`: something unseen stands in front
    else                                  nothing: the circle predicts no echo
    ====================================  =====================================================================

    A cross path counts only within the gate; r is half of it then, and what the circle predicts half the way over it.

    Parameters
    ----------
    readings : (n,) Reading
        Raw ranges.
    cx, cy, radius : float
        Centre and radius ρ, m.
    p : (1,) Settings
        Beam, gate and likelihood.
    noise : int
        Index of the noise that is assumed.
    predicted : Predictions
        Out: what the circle predicts.
    score : Score
        Out: all but `sure_hits`.
    """
    cos_may, cos_half, cos_must = p[0].cos_may_answer, p[0].cos_half_angle, p[0].cos_must_answer
    gate, missed, short = p[0].gate_m, p[0].missed_echo_nat, p[0].short_echo_nat
    llr = 0.0
    hits = 0.0
    misses = 0.0
    near = 0.0
    axis_x = 0.0
    axis_y = 0.0
    closest = NONE_YET
    predict_circle(readings, cx, cy, radius, predicted)
    for j in range(len(readings)):
        q = readings[j]
        d, ahead, e = predicted.distance[j], predicted.ahead[j], predicted.error[j]
        if abs(e) > gate and is_crossed(q):
            continue
        if e > gate:
            if ahead >= cos_must * d:
                llr += missed
                misses += 1.0
        elif e > -gate:
            near += 1.0
            if ahead >= cos_may * d:
                v = log_likelihood(p, level_of(p, noise, q.range_m), e)
                if ahead < cos_half * d:
                    v = max(v, 0.0)
                if v > 0.0:
                    hits += 1.0
                    closest = min(closest, q.range_m)
                    axis_x += q.axis_x
                    axis_y += q.axis_y
                llr += v
        elif ahead >= cos_must * d:
            llr += short
    extra = misses - DROP_OUT_SHARE * (hits + misses)
    if extra > 1.0:
        llr -= DROP_OUT_NAT * (extra - 1.0)
    score.log_likelihood_ratio = llr
    score.hits = hits
    score.misses = misses
    score.near = near
    score.closest = closest
    score.dispersion = 1.0 - math.sqrt(axis_x * axis_x + axis_y * axis_y) / max(hits, 1.0)


Circle: TypeAlias = tuple[float, float, float]
"""Centre x, y and radius, m."""
NoiseVariance: TypeAlias = tuple[float, float]
"""var0 and rel2, as of `noise_estimation.noise_variance`: the variance of a range r is var0 (m²) + rel2 · r²."""
Near: TypeAlias = tuple[float, float]
"""Cosine of the angle off the axis within which a reading may be answered, and how far off it may be, m."""


@kernel
def fit_circle(
    readings: Records[Reading],
    circle: Circle,
    p: Records[Settings],
    soft: float,
    noise: NoiseVariance,
    steps: int,
    predicted: Predictions,
    fit: CircleFit,
) -> bool:
    """Fit the centre of a circle of known radius by robust, damped Gauss–Newton on the raw ranges.

    With û the direction from a sensor to the centre and g the weight of its residual e, a step solves
    (Σ g û ûᵀ + λ I) δ = Σ g e û, λ a share of the trace. The readings that take part are chosen anew in each step.

    Parameters
    ----------
    readings, p
        As for `score_circle`.
    circle : Circle
        Its centre is where the fit starts.
    soft : float
        How many σ² a residual may have before it counts for a quarter.
    noise : NoiseVariance
        Of the ranges.
    steps : int
        At most.
    predicted : Predictions
        Scratch.
    fit : CircleFit
        Out: the centre, and the information of the last step without the damping.

    Returns
    -------
    bool
        False where a step was singular; `fit` is untouched then.
    """
    cos_may, gate = p[0].cos_may_answer, p[0].gate_m
    x, y, radius = circle
    var0, rel2 = noise
    a = 0.0
    b = 0.0
    c = 0.0
    for _ in range(steps):
        a = NO_INFORMATION / var0
        b = 0.0
        c = NO_INFORMATION / var0
        gx = 0.0
        gy = 0.0
        predict_circle(readings, x, y, radius, predicted)
        for j in range(len(readings)):
            d, e = predicted.distance[j], predicted.error[j]
            if abs(e) > gate or d == 0.0 or predicted.ahead[j] < cos_may * d:
                continue
            r = readings[j].range_m
            g = robust_weight(e, var0 + rel2 * r * r, soft)
            dx, dy = predicted.slope_x[j], predicted.slope_y[j]
            a += g * dx * dx
            b += g * dx * dy
            c += g * dy * dy
            gx += g * dx * e
            gy += g * dy * e
        held = FIT_DAMPING * (a + c)
        det = (a + held) * (c + held) - b * b
        if det <= 0.0:
            return False
        sx = ((c + held) * gx - b * gy) / det
        sy = ((a + held) * gy - b * gx) / det
        step = math.sqrt(sx * sx + sy * sy)
        if step > FIT_STEP_MAX_GATES * gate:
            sx *= FIT_STEP_MAX_GATES * gate / step
            sy *= FIT_STEP_MAX_GATES * gate / step
        x += sx
        y += sy
        if step < FIT_STEP_MIN_GATES * gate:
            break
    fit.x = x
    fit.y = y
    fit.information_xx = a
    fit.information_xy = b
    fit.information_yy = c
    return True


@kernel
def fit_reading_line(
    readings: Records[Reading],
    start: tuple[float, float, float],
    origin: tuple[float, float],
    near: Near,
    soft: float,
    noise: NoiseVariance,
    steps: int,
    fit: LineFit,
) -> None:
    """Fit a line n·(p − o) = c by robust, damped Gauss–Newton on the raw ranges, over the normal's direction and c.

    Parameters
    ----------
    readings, soft, noise, steps
        As for `fit_circle`.
    start : (float, float, float)
        Unit normal x, y, away from the sensors, and distance from o (m) to start from.
    origin : (float, float)
        The origin o, m: near the readings, so that direction and distance hardly correlate.
    near : Near
        Which readings take part.
    fit : LineFit
        Out: unit normal and c (m), for the rays it gives.
    """
    nx, ny, c = start
    ox, oy = origin
    cos_may, gate = near
    var0, rel2 = noise
    alpha = math.atan2(ny, nx)
    for _ in range(steps):
        nx = math.cos(alpha)
        ny = math.sin(alpha)
        h00 = 1e3 * NO_INFORMATION
        h01 = 0.0
        h11 = NO_INFORMATION / var0
        g0 = 0.0
        g1 = 0.0
        for j in range(len(readings)):
            q = readings[j]
            px = q.x - ox
            py = q.y - oy
            away = c - nx * px - ny * py
            half, by_own, by_listener = over_line(q, nx, ny, away)
            slant = 0.0
            least = cos_may
            by_ray = fit.rays > 0 and not is_crossed(q)
            if by_ray:
                half, slant = ray_over_line(q, nx, ny, away, fit.half_angle, fit.rays)
                least = GRAZING_MIN
            e = q.range_m - half
            if abs(e) > gate or nx * q.axis_x + ny * q.axis_y < least:
                continue
            g = robust_weight(e, var0 + rel2 * q.range_m * q.range_m, soft)
            lever = ny * px - nx * py  # the range's derivative by the normal's direction, …
            slope = 1.0  # … and by the distance
            if by_ray:
                slope = math.sqrt(1.0 + slant * slant)
                lever = slope * (lever + away * slant)
            if is_crossed(q):
                slope = by_own + by_listener
                lever = slope * lever + by_listener * (ny * q.listener_x - nx * q.listener_y)
            h00 += g * lever * lever
            h01 += g * lever * slope
            h11 += g * slope * slope
            g0 += g * lever * e
            g1 += g * slope * e
        h00 *= 1.0 + FIT_DAMPING
        h11 *= 1.0 + FIT_DAMPING
        det = h00 * h11 - h01 * h01
        if det <= 1e-3 * NO_INFORMATION / var0:  # no reading took part
            break
        turn = (h11 * g0 - h01 * g1) / det
        alpha += min(FIT_TURN_MAX_RAD, max(-FIT_TURN_MAX_RAD, turn))
        c += (h00 * g1 - h01 * g0) / det
        if abs(turn) < FIT_TURN_MIN_RAD:
            break
    fit.normal_x = math.cos(alpha)
    fit.normal_y = math.sin(alpha)
    fit.distance = c


@kernel
def score_line(
    readings: Records[Reading],
    line: LineFit,
    ox: float,
    oy: float,
    p: Records[Settings],
    noise: int,
    score: LineScore,
) -> None:
    """Score readings for a line, as `score_circle`; silence counts only between the feet of the line's own hits.

    Parameters
    ----------
    readings, p, noise
        As for `score_circle`.
    line, ox, oy
        The line n·(p − o) = c: unit normal and distance (m), and the origin o (m).
    score : LineScore
        Out; the extent is along (−ny, nx) from o.
    """
    cos_may, cos_half, cos_must = p[0].cos_may_answer, p[0].cos_half_angle, p[0].cos_must_answer
    gate, missed = p[0].gate_m, p[0].missed_echo_nat
    nx, ny, c = line.normal_x, line.normal_y, line.distance
    llr = 0.0
    hits = 0.0
    misses = 0.0
    low = NONE_YET
    high = -NONE_YET
    if line.rays > 0:
        cos_may = cos_half = cos_must = GRAZING_MIN  # a ray meets a line at any angle
    for j in range(len(readings)):
        q = readings[j]
        ahead = nx * q.axis_x + ny * q.axis_y
        if ahead < cos_may or q.range_m >= FAR:
            continue
        px = q.x - ox
        py = q.y - oy
        away = c - nx * px - ny * py
        half, _, _ = over_line(q, nx, ny, away)
        slant = 0.0
        if line.rays > 0 and not is_crossed(q):
            half, slant = ray_over_line(q, nx, ny, away, line.half_angle, line.rays)
        e = q.range_m - half
        if abs(e) < gate:
            v = log_likelihood(p, level_of(p, noise, q.range_m), e)
            if ahead < cos_half:
                v = max(v, 0.0)
            llr += v
            if v > 0.0:
                hits += 1.0
                foot = -ny * px + nx * py - away * slant
                low = min(low, foot)
                high = max(high, foot)
    for j in range(len(readings)):
        q = readings[j]
        if is_crossed(q):
            continue
        px = q.x - ox
        py = q.y - oy
        away = c - nx * px - ny * py
        predicted = away
        slant = 0.0
        if line.rays > 0:
            predicted, slant = ray_over_line(q, nx, ny, away, line.half_angle, line.rays)
        if predicted > 0.0 and q.range_m - predicted > gate and nx * q.axis_x + ny * q.axis_y >= cos_must:
            foot = -ny * px + nx * py - away * slant
            if low < foot < high:
                llr += missed
                misses += 1.0
    score.log_likelihood_ratio = llr
    score.hits = hits
    score.misses = misses
    score.low = low
    score.high = high
