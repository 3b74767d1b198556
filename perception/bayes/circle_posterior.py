"""Where a circle's centre is, and how well that is known: mean and covariance of the exact likelihood.

Rounded ranges without noise leave a polygon of equally likely centres, and noisy ones a bell. Least squares takes the
first for the second and stays two to four times worse than the polygon's middle. So the posterior is added up as it
is, on a small grid laid where the last one found its mass: a track starts warm, and 49 cells are enough whatever the
shape. The pitch is one expected standard deviation, in the frame of the covariance's Cholesky root, so that a centre
known well along the beam and badly across it is sampled alike in both.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from perception.bayes.range_fit import level_of
from perception.kernel import Floats, Ints, kernel

SIDE: Final = 7
"""Cells along a side of the grid; odd, so that one lies on the mean."""

CELLS: Final = 49
"""SIDE²: rows of `work` that column 4 needs."""

ATTEMPTS: Final = 4
"""How often a grid is laid at most: the bound on the work."""

NEGLIGIBLE: Final = 30.0
"""A cell this many nats below the best one weighs nothing."""

OFF_CENTRE: Final = 1.2
"""A mean this many pitches off the grid's middle asks for a new grid."""

NARROW: Final = 0.3
WIDE: Final = 2.2
"""Variances, in squared pitches, beyond which the grid is too coarse or too small: 1 is as expected."""

THINNEST: Final = 0.06
"""Least variance, in squared pitches, that the next grid believes: less falls between the cells."""

CORRELATED: Final = 0.95
"""Greatest correlation the next grid believes."""

GROWTH: Final = 2.0
"""Where the best cell lies on the rim the covariance is taken this much greater."""

FINEST: Final = 2e-4
"""Least σ of the frame, in gates; its greatest is one gate, beyond which no reading takes part."""


@kernel
def linearise(
    w: Floats,
    n: int,
    x: float,
    y: float,
    rho: float,
    cos_opt: float,
    gate: float,
    lev: Ints,
    per_metre: float,
    inv_step: Floats,
    root: Floats,
    work: Floats,
    wlev: Ints,
) -> int:
    """Write down each reading's error and its slope along the axes of the frame.

    Parameters
    ----------
    w, n, x, y, rho, cos_opt, gate, lev, per_metre, inv_step, root
        As for `posterior_circle`.
    work : (≥ n, ≥ 4) float
        Out: error (m), its fall per unit of the first and the second axis (m), bins per metre.
    wlev : (≥ n,) int
        Out: level of noise.

    Returns
    -------
    int
        How many readings take part.
    """
    m = 0
    for j in range(n):
        dx = x - w[j, 0]
        dy = y - w[j, 1]
        d = math.sqrt(dx * dx + dy * dy)
        e = w[j, 4] - (d - rho)
        if abs(e) > gate or d == 0.0 or dx * w[j, 2] + dy * w[j, 3] < cos_opt * d:
            continue
        ux = dx / d
        uy = dy / d
        k = level_of(lev, w[j, 4], per_metre)
        work[m, 0] = e
        work[m, 1] = ux * root[0] + uy * root[1]
        work[m, 2] = uy * root[2]
        work[m, 3] = inv_step[k]
        wlev[m] = k
        m += 1
    return m


@kernel
def interpolated(row: Floats, last: float, t: float) -> float:
    """Return a level's log likelihood ratio at bin `t`, as `likelihood.loglik`: the method spends its time here."""
    t = min(t, last)
    b = np.uintp(int(t))  # an index without a sign is not asked whether it counts from the end
    return float(row[b] + (t - int(t)) * (row[np.uintp(int(t) + 1)] - row[b]))


@kernel
def weigh_cells(m: int, table: Floats, work: Floats, wlev: Ints) -> tuple[int, float]:
    """Add up the log likelihood of each cell of the grid.

    Parameters
    ----------
    m : int
        Readings that take part.
    table : (levels, bins) float
        From `likelihood.build_table`.
    work, wlev
        From `linearise`. Column 4 of the last 49 rows of `work`: out, the cells' log likelihoods (nat), the first
        axis outermost.

    Returns
    -------
    (int, float)
        Best cell and its log likelihood.
    """
    last = float(table.shape[1] - 2)
    base = work.shape[0] - CELLS
    for i in range(SIDE):
        a = float(i - SIDE // 2)
        s0 = s1 = s2 = s3 = s4 = s5 = s6 = 0.0
        for j in range(m):  # seven sums at a time: one alone would wait for each addition before it began the next
            e, across, step, row = work[j, 0] - a * work[j, 1], work[j, 2], work[j, 3], table[wlev[j]]
            s0 += interpolated(row, last, abs(e + 3.0 * across) * step)
            s1 += interpolated(row, last, abs(e + 2.0 * across) * step)
            s2 += interpolated(row, last, abs(e + across) * step)
            s3 += interpolated(row, last, abs(e) * step)
            s4 += interpolated(row, last, abs(e - across) * step)
            s5 += interpolated(row, last, abs(e - 2.0 * across) * step)
            s6 += interpolated(row, last, abs(e - 3.0 * across) * step)
        cell = base + SIDE * i
        work[cell, 4], work[cell + 1, 4], work[cell + 2, 4], work[cell + 3, 4] = s0, s1, s2, s3
        work[cell + 4, 4], work[cell + 5, 4], work[cell + 6, 4] = s4, s5, s6
    best = -math.inf
    at = 0
    for cell in range(CELLS):
        if work[base + cell, 4] > best:
            best = work[base + cell, 4]
            at = cell
    return at, best


@kernel
def moments(best: float, work: Floats) -> tuple[float, float, float, float, float]:
    """Return mean and covariance of the grid's mass in pitches: a, b, aa, ab, bb.

    Parameters
    ----------
    best : float
        Greatest log likelihood, nat.
    work
        From `weigh_cells`.
    """
    base = work.shape[0] - CELLS
    z = 0.0
    ma = 0.0
    mb = 0.0
    saa = 0.0
    sab = 0.0
    sbb = 0.0
    for cell in range(CELLS):
        v = work[base + cell, 4] - best
        if v < -NEGLIGIBLE:
            continue
        p = math.exp(v)
        a = float(cell // SIDE - SIDE // 2)
        b = float(cell % SIDE - SIDE // 2)
        z += p
        ma += p * a
        mb += p * b
        saa += p * a * a
        sab += p * a * b
        sbb += p * b * b
    ma /= z
    mb /= z
    return ma, mb, saa / z - ma * ma, sab / z - ma * mb, sbb / z - mb * mb


@kernel
def follow(
    ma: float,
    mb: float,
    saa: float,
    sab: float,
    sbb: float,
    growth: float,
    gate: float,
    pose: Floats,
    root: Floats,
    cov: Floats,
) -> None:
    """Let the frame follow the mass: R ← chol(R F Rᵀ), F the moments' covariance within what a grid can tell.

    Parameters
    ----------
    ma, mb, saa, sab, sbb : float
        From `moments`.
    growth : float
        Factor on the covariance.
    gate : float
        Metres.
    pose, root, cov
        As for `posterior_circle`.
    """
    pose[0] += root[0] * ma
    pose[1] += root[1] * ma + root[2] * mb
    fa = max(saa, THINNEST)
    fb = max(sbb, THINNEST)
    limit = CORRELATED * math.sqrt(fa * fb)
    fc = min(limit, max(-limit, sab))
    r0 = root[0]
    r1 = root[1]
    r2 = root[2]
    cov[0] = growth * (r0 * r0 * fa)
    cov[1] = growth * (r0 * (r1 * fa + r2 * fc))
    cov[2] = growth * (r1 * r1 * fa + 2.0 * r1 * r2 * fc + r2 * r2 * fb)
    least = FINEST * FINEST * gate * gate
    root[0] = math.sqrt(min(max(cov[0], least), gate * gate))
    root[1] = min(max(cov[1] / root[0], -gate), gate)
    root[2] = math.sqrt(min(max(cov[2] - root[1] * root[1], least), gate * gate))


@kernel
def posterior_circle(
    w: Floats,
    n: int,
    rho: float,
    cos_opt: float,
    gate: float,
    lev: Ints,
    per_metre: float,
    table: Floats,
    inv_step: Floats,
    work: Floats,
    wlev: Ints,
    pose: Floats,
    root: Floats,
    cov: Floats,
) -> float:
    """Find mean and covariance of a circle's centre under the exact likelihood of the raw ranges.

    The ranges are linearised about the centre; their log likelihood is added up on a 7 × 7 grid in the frame of
    `root`. Where the mass lies on the rim, off the middle, or is not about one pitch wide, the frame follows it and
    the grid is laid again, four times at most. A polygon (noise → 0) and a bell are the same code.

    Parameters
    ----------
    w : (capacity, 5) float
        Readings: place x, y (m), unit axis, range (m).
    n : int
        Readings in use.
    rho : float
        Radius, m.
    cos_opt : float
        Cosine of the angle off the axis up to which a sensor may answer.
    gate : float
        How far off a range still may be this circle's, m.
    lev : (b,) int
        Levels of noise by range: a row of `likelihood.build_levels`.
    per_metre : float
        Its intervals per metre.
    table, inv_step
        From `likelihood.build_table`.
    work : (≥ max(n, 49), 5) float
        Scratch.
    wlev : (≥ n,) int
        Scratch.
    pose : (≥ 2,) float
        Centre x, y (m): where to start; out, the posterior mean.
    root : (3,) float
        Lower root r00, r10, r11 (m) of the expected covariance; out, of the one found.
    cov : (3,) float
        Out: covariance xx, xy, yy, m².

    Returns
    -------
    float
        Greatest log likelihood, nat.
    """
    best = 0.0
    for _ in range(ATTEMPTS):
        m = linearise(w, n, pose[0], pose[1], rho, cos_opt, gate, lev, per_metre, inv_step, root, work, wlev)
        at, best = weigh_cells(m, table, work, wlev)
        i = at // SIDE
        j = at % SIDE
        rim = i == 0 or i == SIDE - 1 or j == 0 or j == SIDE - 1
        ma, mb, saa, sab, sbb = moments(best, work)
        follow(ma, mb, saa, sab, sbb, GROWTH if rim else 1.0, gate, pose, root, cov)
        fits = min(saa, sbb) >= NARROW and max(saa, sbb) <= WIDE
        if fits and not rim and abs(ma) <= OFF_CENTRE and abs(mb) <= OFF_CENTRE:
            break
    return best
