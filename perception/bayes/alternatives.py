"""Other explanations of the very readings an object was made from, each with its own best pose.

Two explanations can be compared only on the same readings; one that was fitted to others would win or lose by what
it was not asked.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.noise_estimation import noise_variance
from perception.bayes.range_fit import fit_circle, fit_line, score_circle, score_line
from perception.bayes.state import NOISE, Settings, State
from perception.kernel import Floats, kernel

SOFT: Final = 9.0
"""Robustness of the fits, σ²."""
HOPELESS: Final = -1e9


@kernel
def mean_bearing(w: Floats, n: int, cx: float, cy: float, rho: float, gate: float) -> tuple[int, float, float]:
    """Return how many readings end near a circle, and the sum of their unit bearings to its centre."""
    m = 0
    sx = 0.0
    sy = 0.0
    for j in range(n):
        dx = cx - w[j, 0]
        dy = cy - w[j, 1]
        d = math.sqrt(dx * dx + dy * dy)
        if abs(w[j, 4] - (d - rho)) < gate and d > 0.0:
            sx += dx / d
            sy += dy / d
            m += 1
    return m, sx, sy


@kernel
def towards(s: State, p: Settings, n: int, cx: float, cy: float, rho: float) -> tuple[float, float]:
    """Return the mean direction from the sensors that hear a circle to its centre; zeros where none does."""
    _, x, y = mean_bearing(s.w, n, cx, cy, rho, p.gate)
    m = math.hypot(x, y)
    if m == 0.0:
        return 0.0, 0.0
    return x / m, y / m


@kernel
def score(s: State, p: Settings, n: int, x: float, y: float, rho: float) -> float:
    """Return the log ratio of a circle on the readings in `s.w`; `s.stats` tells the rest."""
    score_circle(
        s.w, n, x, y, rho, p.cos_opt, p.cos_half, p.cos_in, p.gate, p.miss, p.short, p.levels[int(s.g[NOISE])],
        p.per_metre, p.table, p.inv_step, s.stats,
    )  # fmt: skip
    return float(s.stats[0])


@kernel
def compete_circle(s: State, p: Settings, n: int, cx: float, cy: float, rho: float, rho2: float, steps: int) -> float:
    """Return the log ratio of a circle of another radius on the same surface; `s.fit` holds its centre."""
    ux, uy = towards(s, p, n, cx, cy, rho)
    if ux == 0.0 and uy == 0.0:
        return HOPELESS
    var0, rel2 = noise_variance(s, p)
    k = rho2 - rho
    if not fit_circle(
        s.w, n, cx + k * ux, cy + k * uy, rho2, p.cos_opt, p.gate, SOFT, var0, rel2, steps, s.fit
    ):  # fmt: skip
        return HOPELESS
    return score(s, p, n, s.fit[0], s.fit[1], rho2)


@kernel
def compete_line(s: State, p: Settings, n: int, cx: float, cy: float, rho: float, steps: int) -> float:
    """Return the log ratio of a straight line along the same surface; `s.fit` holds normal and distance about c."""
    ux, uy = towards(s, p, n, cx, cy, rho)
    if ux == 0.0 and uy == 0.0:
        return HOPELESS
    var0, rel2 = noise_variance(s, p)
    fit_line(s.w, n, ux, uy, cx, cy, -rho, p.cos_opt, p.gate, SOFT, var0, rel2, steps, s.fit)
    score_line(
        s.w, n, s.fit[0], s.fit[1], cx, cy, s.fit[2], p.cos_opt, p.cos_half, p.cos_in, p.gate, p.miss,
        p.levels[int(s.g[NOISE])], p.per_metre, p.table, p.inv_step, s.stats,
    )  # fmt: skip
    return float(s.stats[0])
