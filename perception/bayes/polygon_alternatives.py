"""What else a polygon's readings may come from: a wall, a round thing, nothing known."""

from __future__ import annotations

import math
from typing import Final

from config.units import FOOT_M
from perception.bayes.alternatives import SOFT
from perception.bayes.noise_estimation import noise_variance, reach_of
from perception.bayes.polygon_job import HEARD, HISS
from perception.bayes.range_fit import LLR as CIRCLE_LLR
from perception.bayes.range_fit import fit_circle, score_circle
from perception.bayes.refine import bounded_exp
from perception.bayes.state import (
    ESTABLISHED,
    FREE,
    KIND,
    LHI,
    LLO,
    LLR,
    LN,
    LNX,
    LNY,
    MARK,
    MODEL,
    PHITS,
    PLLR,
    PNEAR,
    PPROB,
    PX,
    PY,
    ST,
    TX,
    TY,
    Settings,
    State,
)
from perception.bayes.walls import off_and_along, reaches
from perception.kernel import Floats, kernel

WALL_ECHOES_MIN: Final = 12.0
WALL_SIZE: Final = 3.0
"""A wall is longer than so many inner radii."""
WALL_BEHIND: Final = -1.15
WALL_FRONT: Final = 0.7
"""A body whose centre is so many inner radii behind a wall's face, or before it, is the wall."""
WALL_SHARE: Final = 0.6
"""… and explains so many of its readings for each of its hits. (Bodies in a row have a line in common.)"""
WALL_BEYOND_M: Final = 2.0 * FOOT_M
CIRCLE_NEAR_M: Final = 0.3 * FOOT_M
"""Circles whose centres lie no farther than this off the farthest vertex stand in the same place."""
LEAD: Final = 6.0
"""An established polygon that leads a circle in its place by this removes it, nat."""
FIT_STEPS: Final = 4
"""Steps of a circle's fit."""


@kernel
def on_line(w: Floats, n: int, line: Floats, cos_opt: float, tight: float) -> int:
    """Return how many of `n` readings a line explains: a row of `State.lines`."""
    explained = 0
    for j in range(n):
        ahead, _ = off_and_along(line, w[j, 0], w[j, 1])
        facing_it = line[LNX] * w[j, 2] + line[LNY] * w[j, 3]
        if abs(facing_it) >= cos_opt and facing_it * ahead > 0.0 and abs(w[j, 4] - abs(ahead)) < tight:
            explained += 1
    return explained


@kernel
def is_wall(s: State, p: Settings, t: int) -> bool:
    """Tell whether the body of track `t` is a stretch of a wall: lies in one that explains its readings as well."""
    inner = p.inner[s.pi[t, MODEL]]
    var0, rel2 = noise_variance(s, p)
    for k in range(s.lines.shape[0]):
        line = s.lines[k]
        if line[LN] > WALL_ECHOES_MIN and line[LHI] - line[LLO] > max(p.claim, WALL_SIZE * inner):
            off, along = off_and_along(line, s.pf[t, PX], s.pf[t, PY])
            if reaches(line, along, WALL_BEYOND_M) and WALL_BEHIND * inner < off < WALL_FRONT * inner:
                tight = reach_of(p.half_box, var0 + rel2 * off * off)
                if on_line(s.pw, s.job[HEARD], line, p.cos_opt, tight) >= WALL_SHARE * s.pf[t, PHITS]:
                    return True
    return False


@kernel
def best_circle(s: State, p: Settings, t: int) -> float:
    """Return the log ratio of the circle that best explains the job's readings, prior and all; nat.

    An edge, a post or a drum heard from a few places looks like a body's corner, and the circle that stood there may
    have given way; so it is asked on the very readings that speak for the body.
    """
    x = s.pf[t, PX]
    y = s.pf[t, PY]
    model = s.pi[t, MODEL]
    ux = 0.0
    uy = 0.0
    for j in range(s.job[HEARD]):
        q = s.pw[j]
        dx = x - q[0]
        dy = y - q[1]
        d = math.hypot(dx, dy)
        if d > 0.0 and abs(q[4] - d) < p.bound[model]:
            ux += dx / d
            uy += dy / d
    length = math.hypot(ux, uy)
    if length == 0.0:
        return -math.inf
    lev = p.levels[s.job[HISS]]
    var0, rel2 = noise_variance(s, p)
    best = -math.inf
    for k in range(p.radii.shape[0]):
        rho = p.radii[k]
        behind = (rho - p.inner[model]) / length
        if fit_circle(
            s.pw, s.job[HEARD], x + behind * ux, y + behind * uy, rho, p.cos_opt, p.gate, SOFT, var0, rel2, FIT_STEPS,
            s.fit,
        ):  # fmt: skip
            score_circle(
                s.pw, s.job[HEARD], s.fit[0], s.fit[1], rho, p.cos_opt, p.cos_half, p.cos_in, p.gate, p.miss, p.short,
                lev, p.per_metre, p.table, p.inv_step, s.stats,
            )  # fmt: skip
            best = max(best, s.stats[CIRCLE_LLR] + (p.prior if k < p.models else 0.0))
    return best


@kernel
def compare_circles(s: State, p: Settings, t: int) -> None:
    """Enter the probability of track `t` against nothing, an unknown thing and the circles that stand in its place.

    Circles that are far less likely than an established polygon go.
    """
    track = s.pf[t]
    own = track[PLLR] + p.prior
    around = p.bound[s.pi[t, MODEL]] + CIRCLE_NEAR_M
    total = 1.0 + bounded_exp(-own) + bounded_exp(p.unknown_poly * track[PNEAR] + p.prior - own)
    total += bounded_exp(best_circle(s, p, t) - own)
    for k in range(s.ti.shape[0]):
        if s.ti[k, ST] != FREE and math.hypot(s.tf[k, TX] - track[PX], s.tf[k, TY] - track[PY]) < around:
            v = s.tf[k, LLR] + (p.prior if s.ti[k, KIND] < p.models else 0.0)
            if v < own - LEAD and s.pi[t, ST] == ESTABLISHED and s.names[k, MARK] == 0:
                s.ti[k, ST] = FREE
            elif s.ti[k, ST] == ESTABLISHED:
                total += bounded_exp(v - own)
    track[PPROB] = 1.0 / total
