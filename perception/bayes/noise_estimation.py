"""Which noise the ring has: nobody tells, and everything else depends on it.

Two witnesses. *Roughness* asks no model: of three readings of one sensor in a row the middle one should lie between
the outer two, whatever they hit. The *residuals* of sure objects tell far more finely, but only as far as the
objects are right; so roughness decides what is possible, and both together what is likeliest. Residuals alone let a
false object raise the noise until it fits.
"""

from __future__ import annotations

import math
from typing import Final

from config.units import FOOT_M
from perception.bayes.likelihood import loglik
from perception.bayes.range_fit import FAR
from perception.bayes.state import (
    ESTABLISHED,
    HITS,
    KIND,
    NOISE,
    PROB,
    REFS,
    ST,
    TRHO,
    TX,
    TY,
    Settings,
    State,
)  # fmt: skip
from perception.kernel import Floats, kernel

TWO_PI: Final = 2.0 * math.pi
SIGMAS: Final = 3.0
"""A range this many σ and half its rounding off what is expected is explained."""
TRIPLE_M: Final = 1.0 * FOOT_M
"""Three places farther apart than this hardly see one surface."""
BENT_M2: Final = 1e-4 * FOOT_M * FOOT_M
"""Variance that a curved surface adds."""
FORGET: Final = 0.997
"""What remains of the roughness heard so far after each triple: it remembers some three hundred."""
ELSEWHERE_M: Final = 0.02 / FOOT_M
"""Density of a middle reading that hit something else, 1/m."""
BOX_M2: Final = 1e-6 * FOOT_M * FOOT_M
SURE: Final = 0.95
READINGS_MIN: Final = 25.0
EVERY: Final = 3
"""Only every third refinement of an object asks it."""


@kernel
def noise_variance(s: State, p: Settings) -> tuple[float, float]:
    """Return the variance of a range r that is believed in now, as var0 (m²) and rel2: var0 + rel2 · r²."""
    h = int(s.g[NOISE])
    return p.noises[h, 0] ** 2 + p.half_box**2 / 3.0 + BOX_M2, p.noises[h, 1] ** 2


@kernel
def reach_of(half_box: float, var: float) -> float:
    """Return how far off an explained range is at most, m: rounded by ± `half_box` (m), of variance `var` (m²)."""
    return half_box + SIGMAS * math.sqrt(var)


@kernel
def roughness(
    a: Floats, b: Floats, c: Floats, now: float, gap: float, half_box: float, noises: Floats, heard: Floats
) -> None:  # fmt: skip
    """Hear what three readings of one sensor say of each noise.

    Parameters
    ----------
    a, b, c : (6,) float
        x, y, axis, range, time; the newest first.
    now, gap, half_box, noises
        Time (s) and `Settings`.
    heard : (h,) float
        `State.ddl`. Updated.
    """
    if b[4] >= FAR or c[4] >= FAR or now - c[5] > gap:
        return
    ab = math.hypot(a[0] - b[0], a[1] - b[1])
    bc = math.hypot(b[0] - c[0], b[1] - c[1])
    ac = ab + bc
    if ac > TRIPLE_M or ac == 0.0:
        return
    share = bc / ac
    e = b[4] - share * a[4] - (1.0 - share) * c[4]
    k = 1.0 + share * share + (1.0 - share) ** 2
    for h in range(noises.shape[0]):
        var = k * (noises[h, 0] ** 2 + (noises[h, 1] * b[4]) ** 2 + half_box**2 / 3.0) + BENT_M2
        bell = 0.8 * math.exp(-0.5 * e * e / var) / math.sqrt(TWO_PI * var)
        heard[h] = heard[h] * FORGET + math.log(bell + ELSEWHERE_M)


@kernel
def hear_residuals(s: State, p: Settings, t: int, n: int) -> None:
    """Hear what the residuals of track `t`, whose `n` readings lie in `s.w`, say of each noise, if it is sure."""
    if s.ti[t, ST] != ESTABLISHED or s.ti[t, REFS] % EVERY != 0 or s.ti[t, KIND] >= p.models:
        return
    for h in range(p.noises.shape[0]):
        s.nll[t, h] = 0.0
    if s.tf[t, PROB] < SURE or s.tf[t, HITS] < READINGS_MIN:
        return
    for j in range(n):
        dx = s.tf[t, TX] - s.w[j, 0]
        dy = s.tf[t, TY] - s.w[j, 1]
        d = math.sqrt(dx * dx + dy * dy)
        e = s.w[j, 4] - (d - s.tf[t, TRHO])
        if abs(e) < p.gate and dx * s.w[j, 2] + dy * s.w[j, 3] >= p.cos_half * d:
            b = min(int(s.w[j, 4] * p.per_metre), p.levels.shape[1] - 1)
            for h in range(p.noises.shape[0]):
                s.nll[t, h] += loglik(p.table, p.inv_step, p.levels[h, b], e)
    for h in range(p.noises.shape[0]):
        s.ntot[h] = 0.0
        for k in range(s.ti.shape[0]):
            if s.ti[k, ST] == ESTABLISHED:
                s.ntot[h] += s.nll[k, h]


@kernel
def choose_noise(s: State, p: Settings) -> None:
    """Believe in the likeliest noise by both witnesses, among those that roughness does not rule out."""
    top = -1e300
    for h in range(p.noises.shape[0]):
        top = max(top, s.ddl[h])
    best = -1e300
    for h in range(p.noises.shape[0]):
        v = s.ddl[h] + s.ntot[h]
        if s.ddl[h] > top - p.rough_gate and v > best:
            best = v
            s.g[NOISE] = h
