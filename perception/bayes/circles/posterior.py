"""Posterior of a circle's centre: mean and covariance of the exact likelihood.

Rounded ranges without noise leave a polygon of equally likely centres; noisy ones leave a bell. Least squares assumes
the bell in both cases, and its error is two to four times that of the polygon's middle. So the posterior is summed
numerically on a small grid, laid where the last grid found its mass; with this warm start 49 cells suffice for any
shape. The pitch is one expected standard deviation in the frame of the covariance's Cholesky root, so that a centre
known well along the beam and badly across it is sampled equally in both directions.
"""

from __future__ import annotations

import math

import numpy as np

from perception.bayes.inference.likelihood import level_of
from perception.bayes.inference.prediction import predict_circle
from perception.bayes.memory.elements import GRID_CELLS, GRID_SIDE, Reading
from perception.bayes.memory.parameters import (
    GRID_ATTEMPTS,
    GRID_CORRELATION_MAX,
    GRID_GROWTH,
    GRID_NARROW,
    GRID_NEGLIGIBLE_NAT,
    GRID_OFF_CENTRE,
    GRID_SIGMA_MIN_GATES,
    GRID_THINNEST,
    GRID_WIDE,
)
from perception.bayes.memory.scratch import CirclePosterior, LinearReading, Predictions
from perception.bayes.memory.settings_record import TABLE_BINS, SettingsRecord
from perception.kernel import Floats, kernel
from perception.records import Records


@kernel
def linearise(
    readings: Records[Reading], radius: float, p: SettingsRecord, noise: int, posterior: CirclePosterior,
    predicted: Predictions, linear: Records[LinearReading],
) -> int:  # fmt: skip
    """Write each reading's error and slope along the frame's axes; return the number of readings that count.

    Parameters
    ----------
    readings, radius, p, noise, posterior, predicted
        As for `posterior_circle`.
    linear : (≥ n,) LinearReading
        Out.
    """
    cos_may, gate = p[0].cos_may_answer, p[0].gate_m
    x, y = posterior.x, posterior.y
    root_xx, root_yx, root_yy = posterior.root_xx, posterior.root_yx, posterior.root_yy
    m = 0
    predict_circle(readings, x, y, radius, predicted)
    for j in range(len(readings)):
        d, e = predicted.distance[j], predicted.error[j]
        if abs(e) > gate or d == 0.0 or predicted.ahead[j] < cos_may * d:
            continue
        ux, uy = predicted.slope_x[j], predicted.slope_y[j]
        row = linear[m]
        row.error = e
        row.slope_a = ux * root_xx + uy * root_yx
        row.slope_b = uy * root_yy
        row.level = level_of(p, noise, readings[j].range_m)
        row.bins_per_m = p[0].table_bins_per_m[row.level]
        m += 1
    return m


@kernel
def interpolated(row: Floats, last: float, t: float) -> float:
    """Return a level's log likelihood ratio (nat) at a fractional bin, interpolated linearly as in `likelihood`.

    This is the method's innermost loop.

    Parameters
    ----------
    row : (bins,) float
        A row of `Settings.table`, nat.
    last : float
        Greatest bin to interpolate from; a larger `t` is clipped to it.
    t : float
        Error in bins, ≥ 0.
    """
    t = min(t, last)
    b = np.uintp(int(t))  # an unsigned index is not checked for counting from the end
    return float(row[b] + (t - int(t)) * (row[np.uintp(int(t) + 1)] - row[b]))


@kernel
def score_cells(linear: Records[LinearReading], table: Floats, cells: Floats) -> tuple[int, float]:
    """Sum the log likelihood in each cell of the grid; return the best cell and its log likelihood (nat).

    Parameters
    ----------
    linear : (m,) LinearReading
        From `linearise`.
    table : (levels, bins) float
        From `likelihood.build_table`.
    cells : (GRID_CELLS,) float
        Out: the cells' log likelihoods (nat), the first axis outermost.
    """
    last = float(TABLE_BINS - 2)
    for i in range(GRID_SIDE):
        a = float(i - GRID_SIDE // 2)
        s0 = s1 = s2 = s3 = s4 = s5 = s6 = 0.0
        for j in range(len(linear)):  # seven independent sums at a time: a single one waits for each addition
            q = linear[j]
            e, across, step, row = q.error - a * q.slope_a, q.slope_b, q.bins_per_m, table[q.level]
            s0 += interpolated(row, last, abs(e + 3.0 * across) * step)
            s1 += interpolated(row, last, abs(e + 2.0 * across) * step)
            s2 += interpolated(row, last, abs(e + across) * step)
            s3 += interpolated(row, last, abs(e) * step)
            s4 += interpolated(row, last, abs(e - across) * step)
            s5 += interpolated(row, last, abs(e - 2.0 * across) * step)
            s6 += interpolated(row, last, abs(e - 3.0 * across) * step)
        cell = GRID_SIDE * i
        cells[cell], cells[cell + 1], cells[cell + 2], cells[cell + 3] = s0, s1, s2, s3
        cells[cell + 4], cells[cell + 5], cells[cell + 6] = s4, s5, s6
    best = -math.inf
    at = 0
    for cell in range(GRID_CELLS):
        if cells[cell] > best:
            best = cells[cell]
            at = cell
    return at, best


@kernel
def moments(best: float, cells: Floats) -> tuple[float, float, float, float, float]:
    """Return mean and covariance of the grid's mass, in pitches: a, b, aa, ab, bb.

    Parameters
    ----------
    best : float
        Greatest log likelihood, nat.
    cells : (GRID_CELLS,) float
        From `score_cells`.
    """
    z = 0.0
    ma = 0.0
    mb = 0.0
    saa = 0.0
    sab = 0.0
    sbb = 0.0
    for cell in range(GRID_CELLS):
        v = cells[cell] - best
        if v < -GRID_NEGLIGIBLE_NAT:
            continue
        w = math.exp(v)
        a = float(cell // GRID_SIDE - GRID_SIDE // 2)
        b = float(cell % GRID_SIDE - GRID_SIDE // 2)
        z += w
        ma += w * a
        mb += w * b
        saa += w * a * a
        sab += w * a * b
        sbb += w * b * b
    ma /= z
    mb /= z
    return ma, mb, saa / z - ma * ma, sab / z - ma * mb, sbb / z - mb * mb


@kernel
def move_frame(
    ma: float, mb: float, saa: float, sab: float, sbb: float, growth: float, gate: float, posterior: CirclePosterior
) -> None:
    """Move the frame to the mass: R ← chol(R F Rᵀ), F the moments' covariance limited to what a grid resolves.

    Parameters
    ----------
    ma, mb, saa, sab, sbb : float
        From `moments`.
    growth : float
        Factor on the covariance.
    gate : float
        Metres.
    posterior : CirclePosterior
        Updated.
    """
    r0 = posterior.root_xx
    r1 = posterior.root_yx
    r2 = posterior.root_yy
    posterior.x += r0 * ma
    posterior.y += r1 * ma + r2 * mb
    fa = max(saa, GRID_THINNEST)
    fb = max(sbb, GRID_THINNEST)
    limit = GRID_CORRELATION_MAX * math.sqrt(fa * fb)
    fc = min(limit, max(-limit, sab))
    xx = growth * (r0 * r0 * fa)
    xy = growth * (r0 * (r1 * fa + r2 * fc))
    yy = growth * (r1 * r1 * fa + 2.0 * r1 * r2 * fc + r2 * r2 * fb)
    least = GRID_SIGMA_MIN_GATES * GRID_SIGMA_MIN_GATES * gate * gate
    root_xx = math.sqrt(min(max(xx, least), gate * gate))
    root_yx = min(max(xy / root_xx, -gate), gate)
    posterior.covariance_xx = xx
    posterior.covariance_xy = xy
    posterior.covariance_yy = yy
    posterior.root_xx = root_xx
    posterior.root_yx = root_yx
    posterior.root_yy = math.sqrt(min(max(yy - root_yx * root_yx, least), gate * gate))


@kernel
def posterior_circle(
    readings: Records[Reading], radius: float, p: SettingsRecord, noise: int, predicted: Predictions,
    linear: Records[LinearReading], cells: Floats, posterior: CirclePosterior,
) -> float:  # fmt: skip
    """Write mean and covariance of a circle's centre under the ranges' likelihood; return the greatest one (nat).

    The ranges are linearised about the centre; their log likelihood is summed on a 7 × 7 grid in the frame of the
    root. Where the mass lies on the rim, off the middle, or is not about one pitch wide, the frame moves to it and
    the grid is laid again, four times at most. The same code covers a polygon (noise → 0) and a bell.

    Parameters
    ----------
    readings : (n,) Reading
        Raw ranges.
    radius : float
        m.
    p : (1,) Settings
        Beam, gate and likelihood.
    noise : int
        Index of the noise that is assumed.
    predicted : Predictions
        Scratch.
    linear : (≥ n,) LinearReading
        Scratch.
    cells : (GRID_CELLS,) float
        Scratch.
    posterior : CirclePosterior
        In: start of the centre and root of the expected covariance. Out: the posterior's, with the covariance.

    Returns
    -------
    float
        Greatest log likelihood, nat.
    """
    best = 0.0
    for _ in range(GRID_ATTEMPTS):
        m = linearise(readings, radius, p, noise, posterior, predicted, linear)
        at, best = score_cells(linear[:m], p[0].table, cells)
        i = at // GRID_SIDE
        j = at % GRID_SIDE
        rim = i == 0 or i == GRID_SIDE - 1 or j == 0 or j == GRID_SIDE - 1
        ma, mb, saa, sab, sbb = moments(best, cells)
        move_frame(ma, mb, saa, sab, sbb, GRID_GROWTH if rim else 1.0, p[0].gate_m, posterior)
        fits = min(saa, sbb) >= GRID_NARROW and max(saa, sbb) <= GRID_WIDE
        if fits and not rim and abs(ma) <= GRID_OFF_CENTRE and abs(mb) <= GRID_OFF_CENTRE:
            break
    return best
