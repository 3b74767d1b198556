"""Log likelihood ratio of one range error under rounding, noise and outliers, as a table.

A range is rounded: the true value lies in a box around it, and noise blurs only the box's edges. With this likelihood
a few dozen readings locate a centre several times better than least squares, which assumes a bell. Every value is a
log ratio to the background (an echo of something else anywhere in range), so that a sum over readings is evidence for
or against.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.memory.parameters import TABLE_REACH_SIGMAS
from perception.bayes.memory.settings_record import (
    NOISES,
    RANGE_BINS,
    RANGE_BINS_PER_M,
    TABLE_BINS,
    TABLE_LEVELS,
    NoiseModel,
    Settings,
)
from perception.kernel import Floats, kernel
from perception.records import Records

SHARP: Final = 1e-3
"""Least half box, as a share of σ: below it the difference of two error functions only loses digits."""
EXPONENT_MAX: Final = 60.0
"""Exponents are clipped to ± this: what lies beyond is negligible in a sum."""


@kernel
def bounded_exp(v: float) -> float:
    """Return e to the power of `v`, clipped to ± `EXPONENT_MAX`."""
    return math.exp(min(EXPONENT_MAX, max(-EXPONENT_MAX, v)))


@kernel
def build_table(
    half_box: float,
    sigma_lo: float,
    sigma_hi: float,
    density: float,
    outliers: float,
    table: Floats,
    bins_per_m: Floats,
    sigmas: Floats,
) -> None:
    """Write the table: the log likelihood ratio of an error e for each level of noise.

    With h half the box, σ the noise and Φ the normal distribution, a uniform box convolved with a Gaussian, mixed
    with a share ε of outliers of the background's density u0::

        L(e) = log((1 − ε) · [Φ((e + h)/σ) − Φ((e − h)/σ)] / (2 h u0) + ε)

    which for h → 0 becomes the Gaussian's own density. From the last bin but one on L = log ε. The last bin is
    stored twice, so that an error beyond it is clipped and interpolated without a branch.

    Parameters
    ----------
    half_box : float
        Half the resolution of a range, m.
    sigma_lo, sigma_hi : float
        Least and greatest noise, m.
    density : float
        Density of the background u0, 1/m.
    outliers : float
        Share of outliers ε.
    table : (TABLE_LEVELS, TABLE_BINS) float
        Out: L, nat, at |e| = b / bins_per_m[k] for level k and bin b.
    bins_per_m : (TABLE_LEVELS,) float
        Out: bins per metre of each level.
    sigmas : (TABLE_LEVELS,) float
        Out: noise of each level, m.
    """
    ratio = math.log(sigma_hi / sigma_lo) / (TABLE_LEVELS - 1)
    for k in range(TABLE_LEVELS):
        sigma = sigma_lo * math.exp(ratio * k)
        sigmas[k] = sigma
        bins_per_m[k] = (TABLE_BINS - 2) / (half_box + TABLE_REACH_SIGMAS * sigma)
        for b in range(TABLE_BINS - 2):
            e = b / bins_per_m[k]
            if half_box > SHARP * sigma:
                root = sigma * math.sqrt(2.0)
                p = 0.5 * (math.erfc((e - half_box) / root) - math.erfc((e + half_box) / root)) / (2.0 * half_box)
            else:
                p = math.exp(-0.5 * (e / sigma) ** 2) / (sigma * math.sqrt(2.0 * math.pi))
            table[k, b] = math.log((1.0 - outliers) * max(p, 0.0) / density + outliers)
        table[k, TABLE_BINS - 2] = math.log(outliers)
        table[k, TABLE_BINS - 1] = math.log(outliers)


@kernel
def log_likelihood(p: Records[Settings], level: int, error: float) -> float:
    """Return the log likelihood ratio (nat) of a range error at a noise level, interpolated in the table.

    Parameters
    ----------
    p : (1,) Settings
        The table.
    level : int
        Noise level: the table's row.
    error : float
        Measured range less predicted range, m.
    """
    t = min(abs(error) * p[0].table_bins_per_m[level], float(TABLE_BINS - 2))
    b = int(t)
    row = p[0].table[level]
    return float(row[b] + (t - b) * (row[b + 1] - row[b]))


@kernel
def level_of(p: Records[Settings], noise: int, range_m: float) -> int:
    """Return the table's noise level for a noise hypothesis at a range.

    Parameters
    ----------
    p : (1,) Settings
        The noise hypotheses.
    noise : int
        Index of the hypothesis.
    range_m : float
        Range, m.
    """
    return int(p[0].noises[noise].levels[min(int(range_m * RANGE_BINS_PER_M), RANGE_BINS - 1)])


@kernel
def build_levels(noises: Records[NoiseModel], sigmas: Floats) -> None:
    """Write each noise hypothesis' table level at the middle of each range bin.

    Parameters
    ----------
    noises : (NOISES,) NoiseModel
        Hypotheses; their `levels` are written.
    sigmas : (TABLE_LEVELS,) float
        Noise of each level, m, spaced geometrically.
    """
    last = TABLE_LEVELS - 1
    ratio = math.log(sigmas[last] / sigmas[0]) / last
    for h in range(NOISES):
        noise = noises[h]
        for b in range(RANGE_BINS):
            r = (b + 0.5) / RANGE_BINS_PER_M
            sigma = math.sqrt(noise.absolute_m**2 + (noise.relative * r) ** 2)
            k = round(math.log(max(sigma, sigmas[0]) / sigmas[0]) / ratio)
            noise.levels[b] = min(max(k, 0), last)
