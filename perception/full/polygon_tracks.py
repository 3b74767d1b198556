"""Tracks of polygons: the same life as the circles', with a heading.

A polygon's likelihood has many summits (a face shifted along itself, a body turned by half of what makes it look
alike), so a young track is thrown over to the others now and then. Its top is flat, because ranges are rounded: the
pose is the middle of the plateau and the plateau's width is what is not known.
"""

from __future__ import annotations

import math
from typing import Final

from perception.full.contact import HITS as HIT
from perception.full.contact import NEAR as NEARBY
from perception.full.noise_choice import noise_variance
from perception.full.polygon import ACROSS, ALONG, SURE, TURN, least_miss, moved, predict
from perception.full.polygon_births import WHOLE, bears, pflatten, pput, prestat, pscore
from perception.full.polygon_posterior import centre_polygon
from perception.full.refine import OWED, SIZE, bounded_exp
from perception.full.state import (
    DIRTY,
    ESTABLISHED,
    FREE,
    KIND,
    LC,
    LHI,
    LLO,
    LLR,
    LN,
    LNX,
    LNY,
    LOX,
    LOY,
    MODEL,
    NRES,
    PHITS,
    PLLR,
    PNEAR,
    POLISH,
    PPROB,
    PSURE,
    PTH,
    PX,
    PY,
    QUIET,
    REFS,
    ST,
    TENTATIVE,
    TX,
    TY,
    Settings,
    State,
)  # fmt: skip
from perception.kernel import Floats, kernel

FOOT_M: Final = 0.3048
POLYGON: Final = 1000
"""What polygon t explains belongs to this plus t in `State.owner`."""

YOUNG: Final = 4
AGAIN: Final = 8
"""The search is wide in fewer refinements than the first, in each of so many after, …"""
FITTING: Final = 0.85
"""… and every other time while less than this share of the near readings is explained."""
WIDE_STEP_M: Final = 0.3 * FOOT_M
WIDE_ROUNDS: Final = 14
NARROW_STEP_M: Final = 0.05 * FOOT_M
NARROW_ROUNDS: Final = 6
THROWS: Final = (0.5, -0.5, 1.0, -1.0)
"""A young track is thrown along and across by so many inner radii, …"""
THROW_TURNS: Final = (-0.5, 0.5)
"""… and turned by so many times π over the order of its symmetry."""
THROW_STEP_M: Final = 0.1 * FOOT_M
THROW_ROUNDS: Final = 5
THROW_GAIN: Final = 1.0
"""Another summit must be higher by this, nat."""

WALL_ECHOES_MIN: Final = 12.0
WALL_SIZE: Final = 3.0
"""A wall is longer than so many inner radii."""
WALL_BEHIND: Final = -1.15
WALL_FRONT: Final = 0.7
"""A body whose centre is so many inner radii behind a wall's face, or before it, is the wall."""
WALL_BEYOND_M: Final = 2.0 * FOOT_M

CIRCLE_NEAR_M: Final = 0.3 * FOOT_M
"""Circles whose centres lie no farther than this off the farthest vertex stand in the same place."""
LEAD: Final = 6.0
"""An established polygon that leads a circle in its place by this removes it, nat."""
EVIDENCE_MIN: Final = 5.0
UNKNOWN_LEAD: Final = 8.0
"""Evidence below the first, or behind an unknown thing's by the second, is the end, nat."""
ESTABLISH: Final = 0.9
ESTABLISH_HITS: Final = 16.0
ESTABLISH_SURE: Final = 4.0
"""A track is established by so many hits, and so many that had to be: corners alone fit anywhere."""
DOUBT: Final = 0.3
DOUBT_SHARE: Final = 0.75
SIGMAS: Final = 3.0
"""An echo this near to what is expected is explained."""
TWIN: Final = 0.4
OVERLAP: Final = 1.8
"""Two bodies whose centres are nearer than this, in inner radii, are one; or cannot both be there."""


@kernel
def miss_of(s: State, p: Settings, t: int, q: Floats) -> float:
    """Return by how much a reading misses what polygon track `t` would answer, m; `s.stats` is scratch."""
    model = s.pi[t, MODEL]
    dx = q[0] - s.pf[t, PX]
    dy = q[1] - s.pf[t, PY]
    c = math.cos(s.pf[t, PTH])
    sn = math.sin(s.pf[t, PTH])
    predict(
        c * dx + sn * dy, -sn * dx + c * dy, c * q[2] + sn * q[3], -sn * q[2] + c * q[3], p.verts[model],
        p.nv[model], p.closed[model] > 0, p.cos_opt, p.cos_in, p.cos_half, math.sin(p.half_angle),
        math.sqrt(1.0 - p.cos_in**2), s.stats,
    )  # fmt: skip
    return least_miss(s.stats, q[4])


@kernel
def poly_claims(s: State, p: Settings, m: int, tight: float) -> None:
    """Let established polygons claim what they explain, and all keep what bears on them.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    m : int
        Readings in `s.cur`.
    tight : float
        How far off an explained range is at most, m.
    """
    for t in range(s.pi.shape[0]):
        if s.pi[t, ST] == FREE:
            continue
        s.pi[t, QUIET] += 1
        model = s.pi[t, MODEL]
        x = s.pf[t, PX]
        y = s.pf[t, PY]
        bound = p.bound[model]
        may_claim = s.pi[t, ST] == ESTABLISHED and s.pf[t, PHITS] > WHOLE * s.pf[t, PNEAR]
        for i in range(m):
            q = s.cur[i]
            if not bears(q[0], q[1], q[2], q[3], q[4], x, y, bound, p.half_angle, p.gate, p.pair_max):
                continue
            owner = s.owner[i]
            if 0 <= owner < POLYGON and s.ti[owner, KIND] < p.models:
                continue
            pput(s.pbins, s.pbn, t, x, y, q)
            s.pi[t, DIRTY] += 1
            s.pi[t, QUIET] = 0
            s.pi[t, POLISH] = p.polish
            if may_claim and miss_of(s, p, t, q) < tight:
                s.owner[i] = POLYGON + t


@kernel
def hides(s: State, p: Settings, u: int, t: int, q: Floats) -> bool:
    """Tell whether the body of track `u` stands between the place of a reading and that of track `t`."""
    dx = s.pf[t, PX] - q[0]
    dy = s.pf[t, PY] - q[1]
    ex = s.pf[u, PX] - q[0]
    ey = s.pf[u, PY] - q[1]
    d = math.hypot(dx, dy)
    if d == 0.0:
        return False
    ahead = (dx * ex + dy * ey) / d
    aside = abs(dx * ey - dy * ex) / d
    return 0.0 < ahead < d and bool(aside < p.inner[s.pi[u, MODEL]] + 0.5 * p.inner[s.pi[t, MODEL]])


@kernel
def leave_to_neighbours(s: State, p: Settings, t: int, n: int) -> int:
    """Drop from the first `n` readings in `s.w` what an established neighbour explains better; return how many stay.

    Where bodies all but touch, the echo of one's corner is an outlier to the other, and a dozen are a force; so
    is the silence of what stands in the shade.
    """
    var0, _ = noise_variance(s, p)
    tight = p.half_box + SIGMAS * math.sqrt(var0)
    reach = p.bound[s.pi[t, MODEL]] + p.gate
    for u in range(s.pi.shape[0]):
        if u == t or s.pi[u, ST] != ESTABLISHED:
            continue
        apart = math.hypot(s.pf[u, PX] - s.pf[t, PX], s.pf[u, PY] - s.pf[t, PY])
        if apart > reach + p.bound[s.pi[u, MODEL]] or apart < OVERLAP * p.inner[s.pi[t, MODEL]]:
            continue
        kept = 0
        for j in range(n):
            own = miss_of(s, p, t, s.w[j])
            e = miss_of(s, p, u, s.w[j])
            if (e < tight and e < own) or (own > p.gate and hides(s, p, u, t, s.w[j])):
                continue
            for z in range(5):
                s.w[kept, z] = s.w[j, z]
            kept += 1
        n = kept
    return n


@kernel
def throw(s: State, p: Settings, model: int, n: int) -> None:
    """Look for a higher summit around `s.pose`, updated."""
    best = prestat(s, p, model, n, s.pose)
    x = s.pose[0]
    y = s.pose[1]
    theta = s.pose[2]
    for k in range(2 * len(THROWS) + len(THROW_TURNS)):
        if k < 2 * len(THROWS):
            # both ways along, then both ways across, first near, then far
            far = 2 * (k // 4)
            axis = ALONG if k % 4 < 2 else ACROSS
            step = THROWS[far + k % 2] * p.inner[model]
        else:
            axis = TURN
            step = THROW_TURNS[k - 2 * len(THROWS)] * math.pi / p.sym[model]
        s.root[0], s.root[1], s.root[2] = moved(x, y, theta, axis, step)
        v = pscore(s, p, model, n, s.root, THROW_STEP_M, THROW_ROUNDS)
        if v > best + THROW_GAIN:
            best = v
            s.pose[0] = s.root[0]
            s.pose[1] = s.root[1]
            s.pose[2] = s.root[2]


@kernel
def locate_polygon(s: State, p: Settings, t: int, n: int) -> None:
    """Search for the pose of track `t` and enter it, with what its `n` readings say there."""
    model = s.pi[t, MODEL]
    track = s.pf[t]
    refs = s.pi[t, REFS]
    s.pose[0] = track[PX]
    s.pose[1] = track[PY]
    s.pose[2] = track[PTH]
    is_fitting = track[PHITS] >= FITTING * track[PNEAR]
    if refs < YOUNG or refs % AGAIN == 0 or (not is_fitting and refs % 2 == 0):
        pscore(s, p, model, n, s.pose, WIDE_STEP_M, WIDE_ROUNDS)
        throw(s, p, model, n)
    else:
        pscore(s, p, model, n, s.pose, NARROW_STEP_M, NARROW_ROUNDS)
    track[PLLR] = prestat(s, p, model, n, s.pose)
    track[PX] = s.pose[0]
    track[PY] = s.pose[1]
    track[PTH] = s.pose[2]
    track[PHITS] = s.stats[HIT]
    track[PNEAR] = s.stats[NEARBY]
    track[PSURE] = s.stats[SURE]


@kernel
def is_wall(s: State, x: float, y: float, inner: float, claim: float) -> bool:
    """Tell whether a body of inner radius `inner` (m) at (x, y) is a stretch of a wall longer than `claim` (m)."""
    for k in range(s.lines.shape[0]):
        line = s.lines[k]
        if line[LN] > WALL_ECHOES_MIN and line[LHI] - line[LLO] > max(claim, WALL_SIZE * inner):
            dx = x - line[LOX]
            dy = y - line[LOY]
            off = line[LC] - line[LNX] * dx - line[LNY] * dy
            along = -line[LNY] * dx + line[LNX] * dy
            beside = line[LLO] - WALL_BEYOND_M < along < line[LHI] + WALL_BEYOND_M
            if beside and WALL_BEHIND * inner < off < WALL_FRONT * inner:
                return True
    return False


@kernel
def compare_circles(s: State, p: Settings, t: int) -> None:
    """Enter the probability of track `t` against nothing, an unknown thing and the circles that stand in its place.

    Circles that are far less likely than an established polygon go.
    """
    track = s.pf[t]
    own = track[PLLR] + p.prior
    around = p.bound[s.pi[t, MODEL]] + CIRCLE_NEAR_M
    total = 1.0 + bounded_exp(-own) + bounded_exp(p.unknown_poly * track[PNEAR] + p.prior - own)
    for k in range(s.ti.shape[0]):
        if s.ti[k, ST] != FREE and math.hypot(s.tf[k, TX] - track[PX], s.tf[k, TY] - track[PY]) < around:
            v = s.tf[k, LLR] + (p.prior if s.ti[k, KIND] < p.models else 0.0)
            if v < own - LEAD and s.pi[t, ST] == ESTABLISHED:
                s.ti[k, ST] = FREE
            elif s.ti[k, ST] == ESTABLISHED:
                total += bounded_exp(v - own)
    track[PPROB] = 1.0 / total


@kernel
def judge(s: State, p: Settings, t: int) -> None:
    """Establish track `t`, doubt it or end it."""
    track = s.pf[t]
    if track[PLLR] < EVIDENCE_MIN or track[PLLR] < p.unknown_poly * track[PNEAR] - UNKNOWN_LEAD:
        s.pi[t, ST] = FREE
    elif s.pi[t, ST] == TENTATIVE:
        is_fitting = track[PHITS] > FITTING * track[PNEAR]
        is_heard = track[PHITS] >= ESTABLISH_HITS and track[PSURE] >= ESTABLISH_SURE
        if track[PPROB] > ESTABLISH and is_fitting and is_heard:
            s.pi[t, ST] = ESTABLISHED
    elif track[PPROB] < DOUBT or track[PHITS] < DOUBT_SHARE * track[PNEAR]:
        s.pi[t, ST] = TENTATIVE


@kernel
def merge_polygons(s: State, p: Settings, t: int) -> None:
    """Leave one body in a place: twins merge, and of overlapping ones an established and likelier one stands."""
    inner = p.inner[s.pi[t, MODEL]]
    for k in range(s.pi.shape[0]):
        if k == t or s.pi[k, ST] == FREE:
            continue
        d = math.hypot(s.pf[k, PX] - s.pf[t, PX], s.pf[k, PY] - s.pf[t, PY])
        is_twin = d < TWIN * inner
        if not is_twin and d >= OVERLAP * inner:
            continue
        if s.pf[k, PLLR] > s.pf[t, PLLR]:
            if is_twin or s.pi[k, ST] == ESTABLISHED:
                s.pi[t, ST] = FREE
                return
        elif is_twin or s.pi[t, ST] == ESTABLISHED:
            s.pi[k, ST] = FREE


@kernel
def prefine(s: State, p: Settings, t: int) -> None:
    """Refine polygon track `t`: pose, spread, evidence, probability, and what becomes of it."""
    n = leave_to_neighbours(s, p, t, pflatten(s, t, s.w))
    s.pi[t, NRES] = n
    s.pi[t, DIRTY] = 0
    s.pi[t, REFS] += 1
    locate_polygon(s, p, t, n)
    if is_wall(s, s.pf[t, PX], s.pf[t, PY], p.inner[s.pi[t, MODEL]], p.claim):
        s.pi[t, ST] = FREE
        return
    compare_circles(s, p, t)
    judge(s, p, t)
    if s.pi[t, ST] == ESTABLISHED:
        centre_polygon(s, p, t, n)
    if s.pi[t, ST] != FREE:
        merge_polygons(s, p, t)


@kernel
def pquantum(s: State, p: Settings, threshold: float) -> bool:
    """Refine the polygon with the most unseen evidence for its size, and return whether there was one.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    threshold : float
        Less than this share of unseen evidence is not worth the work.
    """
    best = threshold
    chosen = -1
    for t in range(s.pi.shape[0]):
        if s.pi[t, ST] == FREE:
            continue
        v = s.pi[t, DIRTY] / (s.pi[t, NRES] + SIZE)
        if s.pi[t, QUIET] > p.quiet and s.pi[t, POLISH] > 0:
            v += threshold + OWED
        if v > best:
            best = v
            chosen = t
    if chosen < 0:
        return False
    if s.pi[chosen, QUIET] > p.quiet:
        s.pi[chosen, POLISH] -= 1
    prefine(s, p, chosen)
    return True
