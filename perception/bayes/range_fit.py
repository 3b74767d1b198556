"""Where a sensor's range should end on a circle or a line, what a set of raw ranges says of it, and robust fits.

The true outline takes the place of the paper's chords here: an arc where the body is an arc, so that the chords'
inward bias is gone. A circle answers where the direction to its centre lies in the beam, with the distance less its
radius; a line where its normal does, with its perpendicular distance. What should have answered and did not speaks
against, as loudly as a hit speaks for.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.likelihood import loglik
from perception.kernel import Floats, Ints, kernel

FAR: Final = 1e6
"""A range of this much or more (m) says that nothing was heard."""

LLR: Final = 0
HITS: Final = 1
THROUGHS: Final = 2
NEAR: Final = 3
LOW: Final = 4
HIGH: Final = 5
SHORTS: Final = 6
CLOSEST: Final = 7
DISPERSION: Final = 8
"""Columns of `stats`: evidence (nat); readings that hit; that should have hit and went on; within the gate; ends of a
line's extent (m); readings that ended before; least range of a hit (m); how unlike the axes are that heard it."""

NONE_YET: Final = 1e9
"""Least range and extent (m) of what nothing has hit."""

DROP_SHARE: Final = 0.2
"""Drop-outs are a matter of the sensor up to this share of what should have hit (and one more) …"""

DROP_PRICE: Final = 2.0
"""… and each further one costs this much more, nat: a body that is not there looks just like that."""

DAMPING: Final = 0.02
"""Share of the information that holds a fit where it is, so that directions nothing observes stay put."""

STRIDE: Final = 0.8
"""Longest step of a circle's fit, in gates: farther, and it leaves the readings it was made from."""

REST: Final = 4e-4
"""A step below this many gates ends a circle's fit."""

TURN: Final = 0.2
"""Longest turn of a line's fit, rad."""

STILL: Final = 1e-5
"""A turn below this ends a line's fit, rad."""

NOTHING: Final = 1e-12
"""Information (in single perfect readings) that a fit starts from, to be regular where nothing is heard."""


@kernel
def level_of(lev: Ints, r: float, per_metre: float) -> int:
    """Return the level of noise at a range, from one hypothesis' row of `likelihood.build_levels`."""
    return int(lev[min(int(r * per_metre), lev.shape[0] - 1)])


@kernel
def robust_weight(e: float, var: float, soft: float) -> float:
    """Return the weight of a residual: its information, less the farther it is off.

    1 / (v (1 + e²/(s v))²) is the Geman–McClure weight, with s the number of σ² at which it has fallen to a quarter.
    """
    q = 1.0 / (1.0 + e * e / (soft * var))
    return q * q / var


@kernel
def score_circle(
    w: Floats,
    n: int,
    cx: float,
    cy: float,
    rho: float,
    cos_opt: float,
    cos_half: float,
    cos_in: float,
    gate: float,
    miss: float,
    short: float,
    lev: Ints,
    per_metre: float,
    table: Floats,
    inv_step: Floats,
    stats: Floats,
) -> None:
    """Weigh what readings say of a circle: a log ratio to the background.

    ====================================  =====================================================================
    e = r − (distance to centre − ρ)      counts
    ====================================  =====================================================================
    |e| < gate, centre in the beam        the table's L(e); between half and opt angle only if that is positive
    e > gate, safely in the beam          `miss`: a drop-out; dearer where there are too many of them
    e < −gate, safely in the beam         `short`: something unseen stands in front
    else                                  nothing: the circle predicts no echo
    ====================================  =====================================================================

    Parameters
    ----------
    w : (capacity, 5) float
        Readings: place x, y (m), unit axis, range (m).
    n : int
        Readings in use.
    cx, cy, rho : float
        Centre and radius, m.
    cos_opt, cos_half, cos_in : float
        Cosines of the angles off the axis: may answer, nominal half opening, must answer. Ascending.
    gate : float
        How far off a range still may be this circle's, m.
    miss, short : float
        Nat.
    lev : (b,) int
        Levels of noise by range: a row of `likelihood.build_levels`.
    per_metre : float
        Its intervals per metre.
    table, inv_step
        From `likelihood.build_table`.
    stats : (≥ 9,) float
        Out: columns above, but for `LOW` and `HIGH`.
    """
    llr = 0.0
    hits = 0.0
    throughs = 0.0
    near = 0.0
    shorts = 0.0
    axis_x = 0.0
    axis_y = 0.0
    closest = NONE_YET
    for j in range(n):
        dx = cx - w[j, 0]
        dy = cy - w[j, 1]
        d = math.sqrt(dx * dx + dy * dy)
        ahead = dx * w[j, 2] + dy * w[j, 3]
        e = w[j, 4] - (d - rho)
        if e > gate:
            if ahead >= cos_in * d:
                llr += miss
                throughs += 1.0
        elif e > -gate:
            near += 1.0
            if ahead >= cos_opt * d:
                v = loglik(table, inv_step, level_of(lev, w[j, 4], per_metre), e)
                if ahead < cos_half * d:
                    v = max(v, 0.0)
                if v > 0.0:
                    hits += 1.0
                    closest = min(closest, w[j, 4])
                    axis_x += w[j, 2]
                    axis_y += w[j, 3]
                llr += v
        elif ahead >= cos_in * d:
            llr += short
            shorts += 1.0
    extra = throughs - DROP_SHARE * (hits + throughs)
    if extra > 1.0:
        llr -= DROP_PRICE * (extra - 1.0)
    stats[LLR] = llr
    stats[HITS] = hits
    stats[THROUGHS] = throughs
    stats[NEAR] = near
    stats[SHORTS] = shorts
    stats[CLOSEST] = closest
    stats[DISPERSION] = 1.0 - math.sqrt(axis_x * axis_x + axis_y * axis_y) / max(hits, 1.0)


@kernel
def fit_circle(
    w: Floats,
    n: int,
    cx: float,
    cy: float,
    rho: float,
    cos_opt: float,
    gate: float,
    soft: float,
    var0: float,
    rel2: float,
    steps: int,
    out: Floats,
) -> bool:
    """Fit the centre of a circle of known radius: robust, damped Gauss–Newton on the raw ranges.

    With û the direction from a sensor to the centre and g the weight of its residual e, a step solves
    (Σ g û ûᵀ + λ I) δ = Σ g e û, λ a share of the trace. The readings that take part are chosen anew in each step.

    Parameters
    ----------
    w, n, cx, cy, rho, cos_opt, gate
        As for `score_circle`; the centre is where the fit starts.
    soft : float
        How many σ² a residual may have before it counts for a quarter.
    var0, rel2 : float
        Variance of a range r: var0 (m²) + rel2 · r².
    steps : int
        At most.
    out : (≥ 5,) float
        Out: centre x, y (m); information xx, xy, yy of the last step (1/m²), without the damping.

    Returns
    -------
    bool
        False where a step was singular; `out` is untouched then.
    """
    x = cx
    y = cy
    a = 0.0
    b = 0.0
    c = 0.0
    for _ in range(steps):
        a = NOTHING / var0
        b = 0.0
        c = NOTHING / var0
        gx = 0.0
        gy = 0.0
        for j in range(n):
            dx = x - w[j, 0]
            dy = y - w[j, 1]
            d = math.sqrt(dx * dx + dy * dy)
            e = w[j, 4] - (d - rho)
            if abs(e) > gate or d == 0.0 or dx * w[j, 2] + dy * w[j, 3] < cos_opt * d:
                continue
            g = robust_weight(e, var0 + rel2 * w[j, 4] * w[j, 4], soft)
            dx /= d
            dy /= d
            a += g * dx * dx
            b += g * dx * dy
            c += g * dy * dy
            gx += g * dx * e
            gy += g * dy * e
        held = DAMPING * (a + c)
        det = (a + held) * (c + held) - b * b
        if det <= 0.0:
            return False
        sx = ((c + held) * gx - b * gy) / det
        sy = ((a + held) * gy - b * gx) / det
        step = math.sqrt(sx * sx + sy * sy)
        if step > STRIDE * gate:
            sx *= STRIDE * gate / step
            sy *= STRIDE * gate / step
        x += sx
        y += sy
        if step < REST * gate:
            break
    out[0] = x
    out[1] = y
    out[2] = a
    out[3] = b
    out[4] = c
    return True


@kernel
def fit_line(
    w: Floats,
    n: int,
    nx: float,
    ny: float,
    ox: float,
    oy: float,
    c0: float,
    cos_opt: float,
    gate: float,
    soft: float,
    var0: float,
    rel2: float,
    steps: int,
    out: Floats,
) -> None:
    """Fit a line n·(p − o) = c: robust, damped Gauss–Newton on the raw ranges, over the normal's direction and c.

    Parameters
    ----------
    w, n, cos_opt, gate, soft, var0, rel2, steps
        As for `fit_circle`.
    nx, ny, c0 : float
        Unit normal, away from the sensors, and distance from o (m) to start from.
    ox, oy : float
        The point the line is reckoned about, m: near the readings, so that direction and distance hardly correlate.
    out : (≥ 3,) float
        Out: unit normal x, y and c (m).
    """
    alpha = math.atan2(ny, nx)
    c = c0
    for _ in range(steps):
        nx = math.cos(alpha)
        ny = math.sin(alpha)
        h00 = 1e3 * NOTHING
        h01 = 0.0
        h11 = NOTHING / var0
        g0 = 0.0
        g1 = 0.0
        for j in range(n):
            px = w[j, 0] - ox
            py = w[j, 1] - oy
            e = w[j, 4] - (c - nx * px - ny * py)
            if abs(e) > gate or nx * w[j, 2] + ny * w[j, 3] < cos_opt:
                continue
            g = robust_weight(e, var0 + rel2 * w[j, 4] * w[j, 4], soft)
            lever = ny * px - nx * py  # the range's derivative by the normal's direction
            h00 += g * lever * lever
            h01 += g * lever
            h11 += g
            g0 += g * lever * e
            g1 += g * e
        h00 *= 1.0 + DAMPING
        h11 *= 1.0 + DAMPING
        det = h00 * h11 - h01 * h01
        if det <= 1e-3 * NOTHING / var0:  # no reading took part
            break
        turn = (h11 * g0 - h01 * g1) / det
        alpha += min(TURN, max(-TURN, turn))
        c += (h00 * g1 - h01 * g0) / det
        if abs(turn) < STILL:
            break
    out[0] = math.cos(alpha)
    out[1] = math.sin(alpha)
    out[2] = c


@kernel
def score_line(
    w: Floats,
    n: int,
    nx: float,
    ny: float,
    ox: float,
    oy: float,
    c: float,
    cos_opt: float,
    cos_half: float,
    cos_in: float,
    gate: float,
    miss: float,
    lev: Ints,
    per_metre: float,
    table: Floats,
    inv_step: Floats,
    stats: Floats,
) -> None:
    """Weigh what readings say of a line, as `score_circle`; silence counts only between the feet of its own hits.

    Parameters
    ----------
    w, n, cos_opt, cos_half, cos_in, gate, miss, lev, per_metre, table, inv_step
        As for `score_circle`.
    nx, ny, ox, oy, c : float
        The line n·(p − o) = c: unit normal, point and distance, m.
    stats : (≥ 6,) float
        Out: `LLR`, `HITS`, `THROUGHS`, and the extent `LOW` to `HIGH` along (−ny, nx) from o.
    """
    llr = 0.0
    hits = 0.0
    throughs = 0.0
    low = NONE_YET
    high = -NONE_YET
    for j in range(n):
        ahead = nx * w[j, 2] + ny * w[j, 3]
        if ahead < cos_opt or w[j, 4] >= FAR:
            continue
        px = w[j, 0] - ox
        py = w[j, 1] - oy
        e = w[j, 4] - (c - nx * px - ny * py)
        if abs(e) < gate:
            v = loglik(table, inv_step, level_of(lev, w[j, 4], per_metre), e)
            if ahead < cos_half:
                v = max(v, 0.0)
            llr += v
            if v > 0.0:
                hits += 1.0
                foot = -ny * px + nx * py
                low = min(low, foot)
                high = max(high, foot)
    for j in range(n):
        px = w[j, 0] - ox
        py = w[j, 1] - oy
        predicted = c - nx * px - ny * py
        if predicted > 0.0 and w[j, 4] - predicted > gate and nx * w[j, 2] + ny * w[j, 3] >= cos_in:
            foot = -ny * px + nx * py
            if low < foot < high:
                llr += miss
                throughs += 1.0
    stats[LLR] = llr
    stats[HITS] = hits
    stats[THROUGHS] = throughs
    stats[LOW] = low
    stats[HIGH] = high
