"""What one range is worth under an explanation: rounding, noise and outliers, as a table.

A range comes rounded: the truth lies in a box around it, and only the box's edges are softened by noise. Used as such
a few dozen readings fix a centre several times better than least squares on the same readings, which takes the box
for a bell. Everything is a log ratio to the background, an echo of something else anywhere in range, so that a sum
over readings is evidence for or against.
"""

from __future__ import annotations

import math
from typing import Final

from perception.kernel import Floats, Ints, kernel

LEVELS: Final = 24
"""Noise levels of the table, spaced geometrically: 32 % apart over .001 to .6 ft, finer than a σ can be told."""

BINS: Final = 129
"""Bins of |e| of each level, from 0 to half the box + `REACH` σ, interpolated linearly.

The last bin is there twice, so that an error beyond it is cut off and interpolated like any other, without a branch.
"""

REACH: Final = 6.0
"""σ beyond the box where only outliers are left."""

SHARP: Final = 1e-3
"""Below this share of σ half the box is no box: the difference of two error functions would only lose digits."""


@kernel
def build_table(
    half_box: float,
    sigma_lo: float,
    sigma_hi: float,
    u0: float,
    eps: float,
    table: Floats,
    inv_step: Floats,
    sigmas: Floats,
) -> None:
    """Tabulate the log likelihood ratio of an error e for each level of noise.

    With h half the box, σ the noise and Φ the normal distribution, a uniform box convolved with a Gaussian, mixed
    with a share ε of outliers of the background's density u0::

        L(e) = log((1 − ε) · [Φ((e + h)/σ) − Φ((e − h)/σ)] / (2 h u0) + ε)

    which for h → 0 becomes the Gaussian's own density. From the last bin but one on L = log ε.

    Parameters
    ----------
    half_box : float
        Half the resolution of a range, m.
    sigma_lo, sigma_hi : float
        Least and greatest noise, m.
    u0 : float
        Density of the background, 1/m.
    eps : float
        Share of outliers.
    table : (LEVELS, BINS) float
        Out: L, nat, at |e| = b / inv_step[k] for level k and bin b.
    inv_step : (LEVELS,) float
        Out: bins per metre of each level.
    sigmas : (LEVELS,) float
        Out: noise of each level, m.
    """
    ratio = math.log(sigma_hi / sigma_lo) / (LEVELS - 1)
    for k in range(LEVELS):
        sigma = sigma_lo * math.exp(ratio * k)
        sigmas[k] = sigma
        inv_step[k] = (BINS - 2) / (half_box + REACH * sigma)
        for b in range(BINS - 2):
            e = b / inv_step[k]
            if half_box > SHARP * sigma:
                root = sigma * math.sqrt(2.0)
                p = 0.5 * (math.erfc((e - half_box) / root) - math.erfc((e + half_box) / root)) / (2.0 * half_box)
            else:
                p = math.exp(-0.5 * (e / sigma) ** 2) / (sigma * math.sqrt(2.0 * math.pi))
            table[k, b] = math.log((1.0 - eps) * max(p, 0.0) / u0 + eps)
        table[k, BINS - 2] = math.log(eps)
        table[k, BINS - 1] = math.log(eps)


@kernel
def loglik(table: Floats, inv_step: Floats, k: int, e: float) -> float:
    """Return the log likelihood ratio of an error at level k: the table, interpolated.

    Parameters
    ----------
    table, inv_step
        From `build_table`.
    k : int
        Level of noise.
    e : float
        Range heard less range predicted, m.

    Returns
    -------
    float
        Nat.
    """
    t = min(abs(e) * inv_step[k], float(table.shape[1] - 2))
    b = int(t)
    return float(table[k, b] + (t - b) * (table[k, b + 1] - table[k, b]))


@kernel
def build_levels(noises: Floats, sigmas: Floats, levels: Ints, per_metre: float) -> None:
    """Look up beforehand which level of the table each noise hypothesis means at each range.

    Parameters
    ----------
    noises : (h, 2) float
        Hypotheses: absolute (m) and relative noise; σ² = absolute² + (relative · r)².
    sigmas : (LEVELS,) float
        Noise of each level, m, spaced geometrically.
    levels : (h, b) int
        Out: level at the middle of each interval of range.
    per_metre : float
        Intervals per metre of range.
    """
    last = sigmas.shape[0] - 1
    ratio = math.log(sigmas[last] / sigmas[0]) / last
    for h in range(noises.shape[0]):
        for b in range(levels.shape[1]):
            r = (b + 0.5) / per_metre
            sigma = math.sqrt(noises[h, 0] ** 2 + (noises[h, 1] * r) ** 2)
            k = round(math.log(max(sigma, sigmas[0]) / sigmas[0]) / ratio)
            levels[h, b] = min(max(k, 0), last)
