"""One object at a time: where it is, what speaks for it, what else it might be, and whether it stays.

A quantum of refinement has a bounded cost: a posterior over at most a reservoir of readings, and one rival (all of
them while little is known). What has converged is chosen less and less, see `selection`, so later passes cost less
than the first.
"""

from __future__ import annotations

import math
from typing import Final

from config.units import FOOT_M
from perception.bayes.alternatives import SOFT, compete_circle, compete_line, score
from perception.bayes.circle_posterior import posterior_circle
from perception.bayes.corner_model import wedge
from perception.bayes.lateral_search import ACROSS_M, seek
from perception.bayes.noise_estimation import hear_residuals, noise_variance
from perception.bayes.object_report import call_or_not
from perception.bayes.occlusion import audible
from perception.bayes.range_fit import CLOSEST, DISPERSION, HIGH, LOW, THROUGHS, fit_circle
from perception.bayes.range_fit import HITS as HIT
from perception.bayes.range_fit import NEAR as NEARBY
from perception.bayes.reservoir import flatten
from perception.bayes.state import (
    C00,
    C01,
    C11,
    CALLED,
    CONFIRMED,
    CYC,
    DIRTY,
    ESTABLISHED,
    FREE,
    HITS,
    KIND,
    LLR,
    MARK,
    NEAR,
    NL,
    NOISE,
    NRES,
    POLISH,
    PROB,
    QUIET,
    R00,
    R10,
    R11,
    REFINEMENTS,
    REFS,
    SPAN,
    ST,
    TENTATIVE,
    THRU,
    TRHO,
    TX,
    TY,
    UNK,
    Settings,
    State,
)  # fmt: skip
from perception.bayes.track_initiation import LINE_M, SWITCH, VARIANCE_MAX_M2
from perception.bayes.track_labels import give_up, is_barred, outlives
from perception.bayes.track_selection import CERTAIN, UNSURE_ROOT_M, choose, is_waiting
from perception.bayes.walls import is_wall, new_line, off_and_along, reaches
from perception.kernel import kernel

READINGS_MIN: Final = 3
BASIN: Final = 6.0
"""A robust fit this many σ² off (and the first two refinements) takes the pose over."""
YOUNG: Final = 2
LOST: Final = 2.0
"""A mean this much worse than where it was looked for has left the beams that heard it, nat."""
CORRELATION_MAX: Final = 0.9
ROOT_MIN_M2: Final = 1e-6 * FOOT_M * FOOT_M
SWITCH_ROOT_M: Final = 0.02 * FOOT_M
"""After a change of kind the pose is looked for this far round at least."""
SWITCH_DIRTY: Final = 4
LINE_HITS_MIN: Final = 6.0
THROUGH_SHARE: Final = 0.5
"""A wedge shares this much of the silences that speak against its rival."""
WALL_BEYOND_M: Final = 8.0 * FOOT_M
WALL_BEHIND: Final = -0.85
WALL_FRONT: Final = 0.7
IN_WALL: Final = -8.0
"""A body whose centre lies in a wall, in radii before and behind it, pays this, nat."""
LINE_PRIOR: Final = 1.0
"""Walls are commoner than models by this, nat."""
UNKNOWN_LEAD: Final = 6.0
ESTABLISH: Final = 0.7
ESTABLISH_HITS: Final = 8.0
ESTABLISH_ROOT_M: Final = 0.25 * FOOT_M
DOUBT: Final = 0.2
APART: Final = 0.8
"""Two centres nearer than this share of the larger radius are one object: bodies do not overlap."""
EXP_MAX: Final = 60.0


@kernel
def bounded_exp(v: float) -> float:
    """Return e to the power of `v`, cut off where the rest is nothing."""
    return math.exp(min(EXP_MAX, max(-EXP_MAX, v)))


@kernel
def locate(s: State, p: Settings, t: int, n: int) -> None:
    """Find the basin by a robust fit, and the pose and its covariance by the posterior over it."""
    track = s.tf[t]
    var0, rel2 = noise_variance(s, p)
    rho = track[TRHO]
    steps = 3 if s.ti[t, ST] == TENTATIVE else 2
    if fit_circle(s.w, n, track[TX], track[TY], rho, p.cos_opt, p.gate, SOFT, var0, rel2, steps, s.fit):
        h00, h01, h11 = s.fit[2], s.fit[3], s.fit[4]
        det = h00 * h11 - h01 * h01
        dx = s.fit[0] - track[TX]
        dy = s.fit[1] - track[TY]
        if det > 0.0 and (h00 * dx * dx + 2.0 * h01 * dx * dy + h11 * dy * dy > BASIN or s.ti[t, REFS] <= YOUNG):
            track[TX] = s.fit[0]
            track[TY] = s.fit[1]
            c00 = min(h11 / det, VARIANCE_MAX_M2)
            c11 = min(h00 / det, VARIANCE_MAX_M2)
            limit = CORRELATION_MAX * math.sqrt(c00 * c11)
            track[R00] = math.sqrt(c00)
            track[R10] = min(limit, max(-limit, -h01 / det)) / track[R00]
            track[R11] = math.sqrt(max(c11 - track[R10] ** 2, ROOT_MIN_M2))
    if max(track[R00], track[R11]) > UNSURE_ROOT_M and seek(s, p, t, n):
        track[R00] = max(track[R00], ACROSS_M)
        track[R11] = max(track[R11], ACROSS_M)
    x = track[TX]
    y = track[TY]
    s.pose[0] = x
    s.pose[1] = y
    s.root[0] = track[R00]
    s.root[1] = track[R10]
    s.root[2] = track[R11]
    posterior_circle(
        s.w, n, rho, p.cos_opt, p.gate, p.levels[int(s.g[NOISE])], p.per_metre, p.table, p.inv_step, s.w2, s.wl,
        s.pose, s.root, s.cov,
    )  # fmt: skip
    track[TX] = s.pose[0]
    track[TY] = s.pose[1]
    track[R00] = s.root[0]
    track[R10] = s.root[1]
    track[R11] = s.root[2]
    track[C00] = s.cov[0]
    track[C01] = s.cov[1]
    track[C11] = s.cov[2]
    unsure = max(track[R00], track[R11]) > UNSURE_ROOT_M
    if unsure and score(s, p, n, x, y, rho) > score(s, p, n, track[TX], track[TY], rho) + LOST:
        track[TX] = x
        track[TY] = y


@kernel
def weigh(s: State, p: Settings, t: int, n: int) -> float:
    """Enter what the readings say of the track as it stands; return its prior as a model."""
    track = s.tf[t]
    track[LLR] = score(s, p, n, track[TX], track[TY], track[TRHO])
    track[HITS] = s.stats[HIT]
    track[THRU] = s.stats[THROUGHS]
    track[NEAR] = s.stats[NEARBY]
    track[UNK] = p.unknown * s.stats[NEARBY]
    track[SPAN] = s.stats[DISPERSION]
    s.comp[t, s.ti[t, KIND]] = 0.0
    beyond: float = max(0.0, s.stats[CLOSEST] - p.far)
    return p.prior - p.far_price * beyond


@kernel
def change_kind(s: State, p: Settings, t: int, k: int, v: float) -> None:
    """Make the track what explains it better: radius `k`, whose centre is in `s.fit` and whose log ratio is `v`."""
    track = s.tf[t]
    track[TX] = s.fit[0]
    track[TY] = s.fit[1]
    track[TRHO] = p.radii[k]
    for z in range(s.comp.shape[1]):
        s.comp[t, z] += track[LLR] - v
    s.ti[t, KIND] = k
    s.comp[t, k] = 0.0
    track[LLR] = v
    s.ti[t, REFS] = 0
    s.ti[t, DIRTY] += SWITCH_DIRTY
    track[R00] = max(track[R00], SWITCH_ROOT_M)
    track[R11] = max(track[R11], SWITCH_ROOT_M)


@kernel
def may_become(s: State, t: int, k: int, v: float) -> bool:
    """Tell whether a person's word leaves the track free to become radius `k` at `s.fit`, for which `v` nat speak."""
    return s.names[t, MARK] == 0 and not is_barred(s, s.fit[0], s.fit[1], k, v)


@kernel
def ask_rivals(s: State, p: Settings, t: int, n: int, prior: float) -> bool:
    """Hear the rivals whose turn it is; return whether the track is still an object.

    `s.comp` holds by how much each led when it was asked. (Log ratios of different ages cannot be compared: the
    readings have changed in between.)
    """
    track = s.tf[t]
    circles = p.radii.shape[0]
    var0, rel2 = noise_variance(s, p)
    turns = circles + 2 if n < p.all_until and track[PROB] < CERTAIN else 1
    for _ in range(turns):
        s.ti[t, CYC] = (s.ti[t, CYC] + 1) % (circles + 2)
        if s.ti[t, CYC] == s.ti[t, KIND]:
            s.ti[t, CYC] = (s.ti[t, CYC] + 1) % (circles + 2)
        k = s.ti[t, CYC]
        own_prior = prior if s.ti[t, KIND] < p.models else 0.0
        if k < circles:
            v = compete_circle(s, p, n, track[TX], track[TY], track[TRHO], p.radii[k], 4)
            s.comp[t, k] = v - track[LLR]
            if v + (prior if k < p.models else 0.0) > track[LLR] + own_prior + SWITCH and may_become(s, t, k, v):
                change_kind(s, p, t, k, v)
                break
        elif k == circles:
            v = compete_line(s, p, n, track[TX], track[TY], track[TRHO], 4)
            s.comp[t, k] = v - track[LLR]
            if v > track[LLR] + max(prior, 0.0) + SWITCH:
                if s.stats[HIT] >= LINE_HITS_MIN and s.stats[HIGH] - s.stats[LOW] > LINE_M:
                    new_line(
                        s, s.fit[0], s.fit[1], s.fit[2], track[TX], track[TY],
                        s.stats[LOW], s.stats[HIGH], s.stats[HIT],
                    )  # fmt: skip
                return False
        else:
            v = wedge(
                s.w, s.w2, n, track[TX], track[TY], track[TRHO], p.cos_opt, p.gate, var0, rel2,
                p.levels[int(s.g[NOISE])], p.per_metre, p.table, p.inv_step, s.fit, s.stats,
            )  # fmt: skip
            s.comp[t, k] = v + THROUGH_SHARE * p.miss * track[THRU] - track[LLR]
    return True


@kernel
def stands_in_wall(s: State, x: float, y: float, rho: float) -> bool:
    """Tell whether a body's centre would lie in a known wall or just before or behind it."""
    for k in range(NL):
        line = s.lines[k]
        if is_wall(line):
            off, along = off_and_along(line, x, y)
            if reaches(line, along, WALL_BEYOND_M) and WALL_BEHIND * rho < off < WALL_FRONT * rho:
                return True
    return False


@kernel
def probability(s: State, p: Settings, t: int, prior: float) -> float:
    """Return the share of the track's explanation among all of them: radii, line, wedge, unknown, nothing."""
    track = s.tf[t]
    kind = s.ti[t, KIND]
    circles = p.radii.shape[0]
    own_prior = prior if kind < p.models else 0.0
    inside = IN_WALL if kind < p.models and stands_in_wall(s, track[TX], track[TY], track[TRHO]) else 0.0
    own = track[LLR] + own_prior + inside
    total = 1.0 + bounded_exp(-own) + bounded_exp(track[UNK] + p.prior - own)
    for k in range(circles + 2):
        if k != kind and s.comp[t, k] != 0.0:
            lead = prior if k < p.models else (p.prior + LINE_PRIOR if k == circles else 0.0)
            total += bounded_exp(s.comp[t, k] + lead - own_prior - inside)
    return 1.0 / total


@kernel
def refine(s: State, p: Settings, t: int) -> None:
    """Refine track `t`: pose, evidence, rivals, noise, probability, and what becomes of it."""
    track = s.tf[t]
    n = audible(s, p, flatten(s.bins, s.bn, t, s.w), track[TX], track[TY], track[TRHO], t)
    s.ti[t, NRES] = n
    s.ti[t, DIRTY] = 0
    s.ti[t, REFS] += 1
    s.g[REFINEMENTS] += 1
    if n < READINGS_MIN:
        give_up(s.ti, s.names, t, t)
        return
    locate(s, p, t, n)
    prior = weigh(s, p, t, n)
    if not ask_rivals(s, p, t, n, prior) and give_up(s.ti, s.names, t, t):
        return
    hear_residuals(s, p, t, n)
    track[PROB] = probability(s, p, t, prior)
    if (track[LLR] < 0.0 or track[LLR] < track[UNK] - UNKNOWN_LEAD) and give_up(s.ti, s.names, t, t):
        return
    placed = max(track[R00], track[R11]) < ESTABLISH_ROOT_M
    if s.ti[t, ST] == TENTATIVE and track[PROB] > ESTABLISH and track[HITS] >= ESTABLISH_HITS:
        if track[SPAN] >= p.spread and placed:
            s.ti[t, ST] = ESTABLISHED
    elif s.ti[t, ST] == ESTABLISHED and (track[PROB] < DOUBT or track[SPAN] < 0.5 * p.spread):
        s.ti[t, ST] = TENTATIVE
    call_or_not(s.ti, s.tf, s.comp, p.models, p.report, p.report_near if prior >= p.prior else p.report, t)
    if s.ti[t, CALLED] == 1:
        s.names[t, MARK] &= CONFIRMED
    merge_duplicates(s, p, t)


@kernel
def merge_duplicates(s: State, p: Settings, t: int) -> None:
    """Of two tracks in one place let the one with more evidence stay, or the one that a person spoke of."""
    for k in range(s.ti.shape[0]):
        if k != t and s.ti[k, ST] != FREE:
            apart = max(p.merge, APART * max(s.tf[t, TRHO], s.tf[k, TRHO]))
            if math.hypot(s.tf[k, TX] - s.tf[t, TX], s.tf[k, TY] - s.tf[t, TY]) < apart:
                if outlives(s.names, k, t, s.tf[k, LLR] > s.tf[t, LLR]):
                    s.ti[t, ST] = FREE
                    return
                s.ti[k, ST] = FREE


@kernel
def quantum(s: State, p: Settings, threshold: float) -> bool:
    """Refine the circle whose turn it is; return whether another one is waiting."""
    t = choose(s, p, threshold)
    if t >= 0:
        if s.ti[t, QUIET] > p.quiet:
            s.ti[t, POLISH] -= 1
        refine(s, p, t)
    return is_waiting(s, p, threshold)
