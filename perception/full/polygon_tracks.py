"""Tracks of polygons: the same life as the circles', with a heading.

A polygon's likelihood has many summits (a face shifted along itself, a body turned by half of what makes it look
alike), so a young track is thrown over to the others now and then. Its top is flat, because ranges are rounded: the
pose is the middle of the plateau and the plateau's width is what is not known.
"""

from __future__ import annotations

import math
from typing import Final

from perception.full.contact import HITS as HIT
from perception.full.contact import LLR as CIRCLE_LLR
from perception.full.contact import NEAR as NEARBY
from perception.full.contact import fit_circle, score_circle
from perception.full.noise_choice import noise_variance
from perception.full.polygon import (
    ACROSS,
    ALONG,
    BEST,
    SURE,
    THETA,
    Ear,
    X,
    Y,
    moved,
    predict,
)
from perception.full.polygon_births import (
    WHOLE,
    bears,
    lay_side,
    next_birth,
    pflatten,
    pput,
    try_polygon,
    ways_to_lie,
)
from perception.full.polygon_job import (
    BY_TURNS,
    COV,
    FOUND,
    FOUND_LLR,
    HEARD,
    HISS,
    JOB,
    LAID,
    MIDDLE,
    NEXT,
    NO_JOB,
    QUANTUM,
    STAGE,
    TRACK,
    WHO,
    cost,
    ear_of,
    end_job,
    faces_of,
    seek,
    seek_on,
    sought,
    weigh_pose,
)
from perception.full.polygon_posterior import ATTEMPTS, begin_lattice, lattice_on
from perception.full.refine import OWED, SIZE, bounded_exp
from perception.full.rivals import SOFT
from perception.full.state import (
    CTH,
    CX,
    CY,
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
    NOISE,
    NRES,
    PHITS,
    PLLR,
    PNEAR,
    POLISH,
    PPROB,
    PSURE,
    PTH,
    PTT,
    PX,
    PXX,
    PY,
    QUIET,
    REFS,
    RIVAL,
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

DEAL, LOOK_WIDE, THROW, LOOK_NEAR, JUDGE, SPREAD = range(6)
"""Stages of a refinement."""
COARSE: Final = 96
"""A wide search weighs this many readings at most."""
LOOK_AGAIN: Final = 4
"""A pose whose spread is known and that explains its readings is looked for in every so many refinements only."""
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
"""… turned by so many times π over the order of its symmetry, …"""
ROLLS_MAX: Final = 12
"""… and rolled onto so many of its other sides at most."""
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
WALL_SHARE: Final = 0.6
"""… and explains so many of its readings for each of its hits. (Bodies in a row have a line in common.)"""
WALL_BEYOND_M: Final = 2.0 * FOOT_M

CIRCLE_NEAR_M: Final = 0.3 * FOOT_M
"""Circles whose centres lie no farther than this off the farthest vertex stand in the same place."""
LEAD: Final = 6.0
"""An established polygon that leads a circle in its place by this removes it, nat."""
FIT_STEPS: Final = 4
EVIDENCE_MIN: Final = 5.0
UNKNOWN_LEAD: Final = 8.0
"""Evidence below the first, or behind an unknown thing's by the second, is the end, nat."""
ESTABLISH: Final = 0.9
ESTABLISH_HITS: Final = 14.0
ESTABLISH_SURE: Final = 4.0
MANY_HITS: Final = 20.0
MANY_SURE: Final = 3.0
"""A track is established by so many hits, and so many that had to be: corners alone fit anywhere."""
DOUBT: Final = 0.3
DOUBT_SHARE: Final = 0.75
SIGMAS: Final = 3.0
"""An echo this near to what is expected is explained."""
TWIN: Final = 0.4
OVERLAP: Final = 1.8
"""Two bodies whose centres are nearer than this, in inner radii, are one; or cannot both be there."""


@kernel
def miss_of(q: Floats, track: Floats, faces: Floats, closed: bool, ear: Ear) -> float:
    """Return by how much a reading misses the nearer of what a body would answer by either rule, m.

    Parameters
    ----------
    q : (≥ 5,) float
        The reading: place (m), unit axis, range (m).
    track : (≥ 3,) float
        A row of `State.pf`: pose, m, rad.
    faces, closed, ear
        As for `polygon.predict`.
    """
    dx = q[0] - track[PX]
    dy = q[1] - track[PY]
    c = math.cos(track[PTH])
    sn = math.sin(track[PTH])
    mirror, _, _, cone, _ = predict(
        c * dx + sn * dy, -sn * dx + c * dy, c * q[2] + sn * q[3], -sn * q[2] + c * q[3], faces, closed, ear
    )
    return float(min(abs(q[4] - mirror), abs(q[4] - cone)))


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
    ear = ear_of(p)
    for t in range(s.pi.shape[0]):
        if s.pi[t, ST] == FREE:
            continue
        s.pi[t, QUIET] += 1
        model = s.pi[t, MODEL]
        x = s.pf[t, PX]
        y = s.pf[t, PY]
        bound = p.bound[model]
        faces = faces_of(p, model)
        may_claim = s.pi[t, ST] == ESTABLISHED and s.pf[t, PHITS] > WHOLE * s.pf[t, PNEAR]
        for i in range(m):
            q = s.cur[i]
            if not bears(q[0], q[1], q[2], q[3], q[4], x, y, bound, ear.cos_half, ear.sin_half, p.gate, p.pair_max):
                continue
            owner = s.owner[i]
            if 0 <= owner < POLYGON and s.ti[owner, KIND] < p.models:
                continue
            pput(s.pbins, s.pbn, t, x, y, q)
            s.pi[t, DIRTY] += 1
            s.pi[t, QUIET] = 0
            s.pi[t, POLISH] = p.polish
            if may_claim and miss_of(q, s.pf[t], faces, p.closed[model] > 0, ear) < tight:
                s.owner[i] = POLYGON + t


@kernel
def hides(q: Floats, x: float, y: float, inner: float, ux: float, uy: float, u_inner: float) -> bool:
    """Tell whether a body at (ux, uy) stands between the place of a reading and one at (x, y)."""
    dx = x - q[0]
    dy = y - q[1]
    ex = ux - q[0]
    ey = uy - q[1]
    d = math.hypot(dx, dy)
    if d == 0.0:
        return False
    ahead = (dx * ex + dy * ey) / d
    aside = abs(dx * ey - dy * ex) / d
    return 0.0 < ahead < d and bool(aside < u_inner + 0.5 * inner)


@kernel
def leave_to_next_neighbour(s: State, p: Settings, t: int) -> int:
    """Drop from the job's readings what the next established neighbour explains better; return what that cost.

    Where bodies all but touch, the echo of one's corner is an outlier to the other, and a dozen are a force; so
    is the silence of what stands in the shade.
    """
    u = s.job[NEXT]
    s.job[NEXT] += 1
    n = s.job[HEARD]
    if u == t or s.pi[u, ST] != ESTABLISHED:
        return 1
    own = s.pf[t]
    other = s.pf[u]
    model = s.pi[t, MODEL]
    u_model = s.pi[u, MODEL]
    apart = math.hypot(other[PX] - own[PX], other[PY] - own[PY])
    if apart > p.bound[model] + p.gate + p.bound[u_model] or apart < OVERLAP * p.inner[model]:
        return 1
    var0, _ = noise_variance(s, p)
    tight = p.half_box + SIGMAS * math.sqrt(var0)
    ear = ear_of(p)
    faces = faces_of(p, model)
    u_faces = faces_of(p, u_model)
    kept = 0
    for j in range(n):
        q = s.pw[j]
        ours = miss_of(q, own, faces, p.closed[model] > 0, ear)
        theirs = miss_of(q, other, u_faces, p.closed[u_model] > 0, ear)
        if theirs < tight and theirs < ours:
            continue
        if ours > p.gate and hides(q, own[PX], own[PY], p.inner[model], other[PX], other[PY], p.inner[u_model]):
            continue
        for z in range(5):
            s.pw[kept, z] = q[z]
        kept += 1
    s.job[HEARD] = kept
    return cost(n, 1, faces.shape[0] + u_faces.shape[0])


@kernel
def search_first(s: State, t: int) -> None:
    """Set out for the pose: widely while little is known or explained, else near by, or not at all."""
    track = s.pf[t]
    refs = s.pi[t, REFS]
    is_fitting = track[PHITS] >= FITTING * track[PNEAR]
    s.work[FOUND : FOUND + 3] = track[PX : PTH + 1]
    if refs < YOUNG or refs % AGAIN == 0 or s.pi[t, RIVAL] > 0 or (not is_fitting and refs % 2 == 0):
        seek(s, track[PX], track[PY], track[PTH], WIDE_STEP_M, WIDE_ROUNDS, COARSE)
        s.job[STAGE] = LOOK_WIDE
    elif track[PXX] > 0.0 and is_fitting and refs % LOOK_AGAIN != 0:
        s.job[STAGE] = JUDGE  # the lattice follows the pose by itself
    else:
        search_near(s)


@kernel
def search_near(s: State) -> None:
    """Set out from what has been found, on all readings."""
    seek(s, s.work[FOUND], s.work[FOUND + 1], s.work[FOUND + 2], NARROW_STEP_M, NARROW_ROUNDS, s.pw.shape[0])
    s.job[STAGE] = LOOK_NEAR


@kernel
def keep_found(s: State) -> None:
    """Enter the search's pose as the best."""
    s.work[FOUND] = s.work[X]
    s.work[FOUND + 1] = s.work[Y]
    s.work[FOUND + 2] = s.work[THETA]
    s.work[FOUND_LLR] = s.work[BEST]


@kernel
def facing(s: State, faces: Floats, closed: bool) -> tuple[int, float]:
    """Return which side of the pose at `MIDDLE` looks most at where the job's readings are from, and its hand.

    The hand is −1 where they are on the inner side of an open outline.
    """
    x = 0.0
    y = 0.0
    for j in range(s.job[HEARD]):
        x += s.pw[j, 0] / s.job[HEARD]
        y += s.pw[j, 1] / s.job[HEARD]
    dx = x - s.work[MIDDLE]
    dy = y - s.work[MIDDLE + 1]
    c = math.cos(s.work[MIDDLE + 2])
    sn = math.sin(s.work[MIDDLE + 2])
    bx = c * dx + sn * dy
    by = -sn * dx + c * dy
    best = -math.inf
    side = 0
    hand = 1.0
    for k in range(faces.shape[0]):
        mx = bx - faces[k, 0] - 0.5 * faces[k, 4] * faces[k, 2]
        my = by - faces[k, 1] - 0.5 * faces[k, 4] * faces[k, 3]
        v = (mx * faces[k, 3] - my * faces[k, 2]) / math.hypot(mx, my)
        if (v if closed else abs(v)) > best:
            best = v if closed else abs(v)
            side = k
            hand = 1.0 if v >= 0.0 else -1.0
    return side, hand


@kernel
def roll(s: State, p: Settings, model: int, k: int) -> bool:
    """Set `s.pose` to the one at `MIDDLE` rolled on: the `k`-th other side lies where one was; return if there is."""
    faces = faces_of(p, model)
    closed = p.closed[model] > 0
    ways = ways_to_lie(p, model)
    if k >= min(ways, ROLLS_MAX + 1):
        return False
    side, hand = facing(s, faces, closed)
    c = math.cos(s.work[MIDDLE + 2])
    sn = math.sin(s.work[MIDDLE + 2])
    f = faces[side]
    x = f[0] + 0.5 * f[4] * f[2]
    y = f[1] + 0.5 * f[4] * f[3]
    nx = -hand * f[3]
    ny = hand * f[2]
    # alternately the sides before and after
    turned = ((k + 1) // 2 if k % 2 == 1 else ways - k // 2) + (side if hand > 0.0 else side + faces.shape[0])
    turned %= ways
    flip = 1.0 if turned < faces.shape[0] else -1.0
    lay_side(
        s, p, model, turned % faces.shape[0], 0.0, s.work[MIDDLE] + c * x - sn * y,
        s.work[MIDDLE + 1] + sn * x + c * y, flip * (c * nx - sn * ny), flip * (sn * nx + c * ny),
    )  # fmt: skip
    return True


@kernel
def throw_next(s: State, p: Settings, t: int) -> None:
    """Set out for the next of the other summits around the first that was found, if one is left.

    They are the pose thrown along, across and turned, rolled onto its other sides, and a challenger's.
    """
    model = s.pi[t, MODEL]
    k = s.job[NEXT]
    s.job[NEXT] += 1
    shifts = 2 * len(THROWS)
    turns = shifts + len(THROW_TURNS)
    x, y, theta = s.work[MIDDLE], s.work[MIDDLE + 1], s.work[MIDDLE + 2]
    if k < shifts:
        # both ways along, then both ways across, first near, then far
        step = THROWS[2 * (k // 4) + k % 2] * p.inner[model]
        x, y, theta = moved(x, y, theta, ALONG if k % 4 < 2 else ACROSS, step)
    elif k < turns:
        theta += THROW_TURNS[k - shifts] * math.pi / p.sym[model]
    elif roll(s, p, model, k - turns + 1):
        x, y, theta = s.pose[0], s.pose[1], s.pose[2]
    elif s.pi[t, RIVAL] > 0:
        s.pi[t, RIVAL] = 0
        x, y, theta = s.pf[t, CX], s.pf[t, CY], s.pf[t, CTH]
    else:
        search_near(s)
        return
    seek(s, x, y, theta, THROW_STEP_M, THROW_ROUNDS, COARSE)


@kernel
def on_line(w: Floats, n: int, line: Floats, cos_opt: float, tight: float) -> int:
    """Return how many of `n` readings a line explains: a row of `State.lines`."""
    explained = 0
    for j in range(n):
        ahead = line[LC] - line[LNX] * (w[j, 0] - line[LOX]) - line[LNY] * (w[j, 1] - line[LOY])
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
            dx = s.pf[t, PX] - line[LOX]
            dy = s.pf[t, PY] - line[LOY]
            off = line[LC] - line[LNX] * dx - line[LNY] * dy
            along = -line[LNY] * dx + line[LNX] * dy
            beside = line[LLO] - WALL_BEYOND_M < along < line[LHI] + WALL_BEYOND_M
            if beside and WALL_BEHIND * inner < off < WALL_FRONT * inner:
                tight = p.half_box + SIGMAS * math.sqrt(var0 + rel2 * off * off)
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
            if v < own - LEAD and s.pi[t, ST] == ESTABLISHED:
                s.ti[k, ST] = FREE
            elif s.ti[k, ST] == ESTABLISHED:
                total += bounded_exp(v - own)
    track[PPROB] = 1.0 / total


@kernel
def judge(s: State, p: Settings, t: int) -> None:
    """Establish track `t`, doubt it or end it; what is not placed yet is established once it is."""
    track = s.pf[t]
    if track[PLLR] < EVIDENCE_MIN or track[PLLR] < p.unknown_poly * track[PNEAR] - UNKNOWN_LEAD:
        s.pi[t, ST] = FREE
    elif s.pi[t, ST] == TENTATIVE:
        is_fitting = track[PHITS] > FITTING * track[PNEAR]
        sure = ESTABLISH_SURE if track[PHITS] < MANY_HITS else MANY_SURE
        is_heard = track[PHITS] >= ESTABLISH_HITS and track[PSURE] >= sure
        if track[PPROB] > ESTABLISH and is_fitting and is_heard:
            s.job[STAGE] = SPREAD
            if track[PXX] > 0.0:
                s.pi[t, ST] = ESTABLISHED
    elif track[PPROB] < DOUBT or track[PHITS] < DOUBT_SHARE * track[PNEAR]:
        s.pi[t, ST] = TENTATIVE
    else:
        s.job[STAGE] = SPREAD


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
def next_track(s: State, p: Settings, threshold: float) -> bool:
    """Begin with the polygon with the most unseen evidence for its size; return whether there is one.

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
    s.pi[chosen, DIRTY] = 0
    s.pi[chosen, REFS] += 1
    s.job[JOB] = TRACK
    s.job[STAGE] = DEAL
    s.job[WHO] = chosen
    s.job[NEXT] = 0
    s.job[HISS] = int(s.g[NOISE])
    s.job[HEARD] = pflatten(s.pbins, s.pbn, chosen, s.pw)
    return True


@kernel
def judge_found(s: State, p: Settings, t: int) -> None:
    """Enter the pose that was found, with what the readings say there, and what becomes of the track."""
    track = s.pf[t]
    model = s.pi[t, MODEL]
    x, y, theta = s.work[FOUND], s.work[FOUND + 1], s.work[FOUND + 2]
    track[PLLR] = weigh_pose(s, p, model, x, y, theta)
    track[PX] = x
    track[PY] = y
    track[PTH] = theta
    track[PHITS] = s.stats[HIT]
    track[PNEAR] = s.stats[NEARBY]
    track[PSURE] = s.stats[SURE]
    if is_wall(s, p, t):
        s.pi[t, ST] = FREE
        return
    compare_circles(s, p, t)
    judge(s, p, t)
    if s.pi[t, ST] != FREE:
        merge_polygons(s, p, t)


@kernel
def refine_polygon(s: State, p: Settings, left: int) -> int:
    """Go on with a track for what is left of a quantum; return what that cost.

    Its readings are dealt out between it and its neighbours; its pose is looked for, widely and then near by; what
    the readings say there decides what becomes of it; how well it is known is found last.
    """
    t = s.job[WHO]
    model = s.pi[t, MODEL]
    stage = s.job[STAGE]
    if stage == DEAL:
        if s.job[NEXT] < s.pi.shape[0]:
            return int(leave_to_next_neighbour(s, p, t))
        s.pi[t, NRES] = s.job[HEARD]
        search_first(s, t)
        return 1
    if stage in (LOOK_WIDE, THROW, LOOK_NEAR):
        spent = seek_on(s, p, model, left)
        if sought(s):
            if stage == LOOK_NEAR:
                keep_found(s)
                s.job[STAGE] = JUDGE
                return int(spent)
            if stage == LOOK_WIDE:
                keep_found(s)
                s.work[MIDDLE : MIDDLE + 3] = s.work[FOUND : FOUND + 3]
                s.job[STAGE] = THROW
                s.job[NEXT] = 0
            elif s.work[BEST] > s.work[FOUND_LLR] + THROW_GAIN:
                keep_found(s)
            throw_next(s, p, t)
        return int(spent)
    if stage == JUDGE:
        judge_found(s, p, t)
        if s.pi[t, ST] != FREE and s.job[STAGE] == SPREAD:
            begin_lattice(s, p, model, s.pf[t, PX : PTH + 1], s.pf[t, PXX : PTT + 1])
        else:
            end_job(s)
        return cost((1 + p.radii.shape[0]) * s.job[HEARD], 1, faces_of(p, model).shape[0])
    spent = lattice_on(s, p, model, left)
    if s.job[LAID] == ATTEMPTS:
        s.pf[t, PX : PTH + 1] = s.work[MIDDLE : MIDDLE + 3]
        s.pf[t, PXX : PTT + 1] = s.work[COV : COV + 6]
        s.pi[t, ST] = ESTABLISHED
        end_job(s)
    return int(spent)


@kernel
def pquantum(s: State, p: Settings, threshold: float) -> bool:
    """Go on with the job at hand for a quantum, or else with the next one; return whether there was one.

    Tracks and births take turns where both wait.

    Parameters
    ----------
    s, p, threshold
        As for `next_track`.
    """
    if s.job[JOB] == NO_JOB:
        s.job[BY_TURNS] = 1 - s.job[BY_TURNS]
        if s.job[BY_TURNS] == 1:
            if not next_track(s, p, threshold) and not next_birth(s):
                return False
        elif not next_birth(s) and not next_track(s, p, threshold):
            return False
    left = QUANTUM
    while left > 0 and s.job[JOB] != NO_JOB:
        left -= refine_polygon(s, p, left) if s.job[JOB] == TRACK else try_polygon(s, p, left)
    return True
