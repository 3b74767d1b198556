"""Hypotheses: where a segment that nothing explains says that a model's body would be.

Not from clusters of segments, as the paper has it: a cluster joins drums that stand a foot apart and splits one seen
from two sides. The paper's relaxation then moves the body onto the outline map, as there; whether it is an object is
for the raw readings to say, against every rival.
"""

from __future__ import annotations

import math
from typing import Final

from config.units import FOOT_M
from perception.bayes.alternatives import SOFT, compete_circle, compete_line, score
from perception.bayes.noise_estimation import noise_variance
from perception.bayes.occlusion import audible
from perception.bayes.range_fit import HIGH, LOW, fit_circle
from perception.bayes.range_fit import HITS as HIT
from perception.bayes.range_fit import NEAR as NEARBY
from perception.bayes.reservoir import gather, put
from perception.bayes.segment_pairs import map_near
from perception.bayes.state import (
    BIRTHS,
    BORN,
    C00,
    C11,
    DIRTY,
    FREE,
    KIND,
    LLR,
    MARK,
    PULLING,
    R00,
    R11,
    ST,
    TENTATIVE,
    TRHO,
    TX,
    TY,
    Settings,
    State,
)  # fmt: skip
from perception.bayes.track_labels import give_number, is_barred
from perception.bayes.walls import new_line
from perception.kernel import Floats, Ints, kernel
from perception.relaxation import relax

CELL_M: Final = 1.0 * FOOT_M
"""A cell of the outline map."""
AROUND_M: Final = 0.4 * FOOT_M
"""Segments up to this far off the body may pull."""
FACING: Final = 0.6
"""A segment pulls where the body's centre lies at least this share of its radius behind it."""
PULLING_MIN: Final = 3
GAMMA: Final = 2.0
"""The paper's γ."""
STEPS: Final = 4
NEGLIGIBLE_M: Final = 0.005 * FOOT_M
NEGLIGIBLE_RAD: Final = 0.005
FIRST_SOFT: Final = 16.0
READINGS_MIN: Final = 5
EVIDENCE_MIN: Final = 10.0
SWITCH: Final = 6.0
"""Another explanation must lead by this, nat."""
RIVAL_OVER_UNKNOWN: Final = 3.0
LINE_HITS_MIN: Final = 8.0
LINE_M: Final = 0.8 * FOOT_M
"""A line is kept from this length and so many hits on."""
VARIANCE_MAX_M2: Final = 0.2 * FOOT_M * FOOT_M


@kernel
def free_track(of: Ints, evidence: Floats, names: Ints) -> int:
    """Return a free track, else the tentative one with the least evidence that no person spoke of, else −1.

    Parameters
    ----------
    of : (n, ≥ 1) int
        `State.ti` or `State.pi`.
    evidence : (n,) float
        Log ratio of each to the background, nat.
    names : (≥ n, 2) int
        Its rows of `State.names`.
    """
    worst = math.inf
    slot = -1
    for t in range(of.shape[0]):
        if of[t, ST] == FREE:
            return t
        if of[t, ST] == TENTATIVE and evidence[t] < worst and names[t, MARK] == 0:
            worst = evidence[t]
            slot = t
    return slot


@kernel
def let_pull(mapped: Floats, pull: Floats) -> None:
    """Enter a row of `State.near` as one of `State.pull`: a mapped segment has a middle and a normal, and no ends."""
    pull[0] = mapped[0]
    pull[1] = mapped[1]
    pull[2] = mapped[0]
    pull[3] = mapped[1]
    pull[4] = math.atan2(mapped[3], mapped[2])


@kernel
def is_known(s: State, p: Settings, x: float, y: float, shift: float, nx: float, ny: float) -> bool:
    """Tell whether a track explains the surface of a body at (x, y).

    A track of radius ρ is compared at the centre that a body of radius `shift` with the same surface would have.
    """
    for t in range(s.ti.shape[0]):
        if s.ti[t, ST] != FREE:
            k = shift - s.tf[t, TRHO] if shift >= 0.0 else 0.0
            if math.hypot(x - k * nx - s.tf[t, TX], y - k * ny - s.tf[t, TY]) < p.merge:
                return True
    return False


@kernel
def relax_onto_map(s: State, p: Settings, kind: int) -> None:
    """Move the hypothesis in `s.pose` by the paper's relaxation (§3.4) onto the segments that face it."""
    rho = p.radii[kind]
    m = map_near(s.pose[0], s.pose[1], rho + AROUND_M, CELL_M, s.tags, s.fill, s.store, s.near)
    q = 0
    for j in range(m):
        deep = s.near[j, 2] * (s.pose[0] - s.near[j, 0]) + s.near[j, 3] * (s.pose[1] - s.near[j, 1])
        if deep > FACING * rho:
            let_pull(s.near[j], s.pull[q])
            q += 1
            if q == PULLING:
                break
    if q >= PULLING_MIN:
        relax(p.sides[kind], s.pull, s.all_pull[:q], GAMMA, NEGLIGIBLE_M, NEGLIGIBLE_RAD, STEPS, s.pose)


@kernel
def begin_track(s: State, kind: int, rho: float, x: float, y: float, n: int, now: float) -> int:
    """Found a tentative track on the `n` readings in `s.w` and return it, −1 where there is no room."""
    t = free_track(s.ti, s.tf[:, LLR], s.names)
    if t < 0:
        return -1
    begin_at(s, t, kind, rho, x, y, n, now)
    give_number(s.names, s.tally, t)
    s.g[BIRTHS] += 1
    return t


@kernel
def begin_at(s: State, t: int, kind: int, rho: float, x: float, y: float, n: int, now: float) -> None:
    """Make track `t` a tentative one on the `n` readings in `s.w`."""
    s.ti[t, :] = 0
    s.tf[t, :] = 0.0
    s.comp[t, :] = 0.0
    s.nll[t, :] = 0.0
    s.bn[t, :] = 0
    s.ti[t, ST] = TENTATIVE
    s.ti[t, KIND] = kind
    s.ti[t, DIRTY] = n
    s.tf[t, TX] = x
    s.tf[t, TY] = y
    s.tf[t, TRHO] = rho
    s.tf[t, BORN] = now
    for j in range(n):
        put(s.bins, s.bn, t, x, y, s.w[j])


@kernel
def birth(s: State, p: Settings, kind: int, sx: float, sy: float, nx: float, ny: float, now: float) -> int:
    """Try the body of circle `kind` behind a segment; return 1 if that took work, whatever came of it.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    kind : int
        Index into `p.radii`.
    sx, sy, nx, ny : float
        The segment's middle (m) and unit normal, away from the sensors.
    now : float
        s.
    """
    rho = p.radii[kind]
    s.pose[0] = sx + rho * nx
    s.pose[1] = sy + rho * ny
    s.pose[2] = 0.0
    if is_known(s, p, s.pose[0], s.pose[1], rho, nx, ny):
        return 0
    relax_onto_map(s, p, kind)
    n = audible(s, p, gather(s, p, s.pose[0], s.pose[1], rho, s.w), s.pose[0], s.pose[1], rho, -1)
    if n < READINGS_MIN:
        return 0
    var0, rel2 = noise_variance(s, p)
    if not fit_circle(
        s.w, n, s.pose[0], s.pose[1], rho, p.cos_opt, p.gate, FIRST_SOFT, var0, rel2, STEPS, s.fit
    ):  # fmt: skip
        return 0
    n = audible(s, p, gather(s, p, s.fit[0], s.fit[1], rho, s.w), s.fit[0], s.fit[1], rho, -1)
    if not fit_circle(s.w, n, s.fit[0], s.fit[1], rho, p.cos_opt, p.gate, SOFT, var0, rel2, STEPS, s.fit):
        return 0
    x, y, h00, h01, h11 = s.fit[0], s.fit[1], s.fit[2], s.fit[3], s.fit[4]
    llr = score(s, p, n, x, y, rho)
    near = s.stats[NEARBY]
    if s.stats[HIT] < READINGS_MIN or llr < EVIDENCE_MIN:
        return 1
    own = llr + (p.prior if kind < p.models else 0.0)
    if compete_line(s, p, n, x, y, rho, STEPS) > own + SWITCH:
        if s.stats[HIT] >= LINE_HITS_MIN and s.stats[HIGH] - s.stats[LOW] > LINE_M:
            new_line(s, s.fit[0], s.fit[1], s.fit[2], x, y, s.stats[LOW], s.stats[HIGH], s.stats[HIT])
        return 1
    chosen = kind
    best = own
    bx = x
    by = y
    for k in range(p.radii.shape[0]):
        if k != kind:
            v = compete_circle(s, p, n, x, y, rho, p.radii[k], STEPS) + (p.prior if k < p.models else 0.0)
            if v > best + SWITCH:
                best = v
                chosen = k
                bx = s.fit[0]
                by = s.fit[1]
    if chosen == kind and llr < p.unknown * near:
        return 1
    if chosen != kind and best < p.unknown * near + RIVAL_OVER_UNKNOWN:
        return 1
    if is_known(s, p, bx, by, -1.0, nx, ny) or is_barred(s, bx, by, chosen, best):
        return 1
    t = begin_track(s, chosen, p.radii[chosen], bx, by, n, now)
    if t < 0:
        return 1
    det = h00 * h11 - h01 * h01
    s.tf[t, LLR] = llr
    s.tf[t, C00] = min(h11 / det, VARIANCE_MAX_M2) if det > 0.0 else VARIANCE_MAX_M2
    s.tf[t, C11] = min(h00 / det, VARIANCE_MAX_M2) if det > 0.0 else VARIANCE_MAX_M2
    s.tf[t, R00] = math.sqrt(s.tf[t, C00])
    s.tf[t, R11] = math.sqrt(s.tf[t, C11])
    return 1
