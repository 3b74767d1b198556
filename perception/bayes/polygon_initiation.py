"""Hypotheses of polygons: each distinct side of a model laid on a segment that nothing explains.

As for circles the paper's relaxation moves the body onto the outline map, and the raw readings that the sensors
remember decide. Along a side, contact says little, so each side is tried shifted as well. To propose one takes no
time; to try it is a job.
"""

from __future__ import annotations

import math
from typing import Final

from config.units import FOOT_M
from perception.bayes.polygon_job import (
    BIRTH,
    FOUND,
    FOUND_LLR,
    HEARD,
    HISS,
    JOB,
    NEXT,
    QUESTIONS,
    SEGMENT,
    STAGE,
    WHO,
    end_job,
    seek,
    seek_on,
    sought,
    weigh_pose,
)
from perception.bayes.polygon_likelihood import BEST, THETA, X, Y
from perception.bayes.polygon_readings import collect
from perception.bayes.range_fit import HITS as HIT
from perception.bayes.range_fit import NEAR as NEARBY
from perception.bayes.reservoir import put
from perception.bayes.segment_pairs import map_near
from perception.bayes.state import (
    CTH,
    CX,
    CY,
    DIRTY,
    ESTABLISHED,
    FREE,
    MODEL,
    NOISE,
    PHITS,
    PLLR,
    PNEAR,
    PTH,
    PULLING,
    PX,
    PY,
    RIVAL,
    ST,
    TENTATIVE,
    Settings,
    State,
)  # fmt: skip
from perception.bayes.track_initiation import CELL_M, GAMMA, free_track, let_pull
from perception.bayes.track_labels import POLYGON as POLYGON_BAR
from perception.bayes.track_labels import give_number, is_barred
from perception.kernel import Floats, kernel
from perception.relaxation import relax

LAY, TRY, FINE = range(3)
"""Stages of a birth: a side is laid on the segment, tried, and the best trial is looked at closely."""
GATHERING: Final = 800
"""What gathering readings costs, in the job's currency."""
SAME_M: Final = 0.25 * FOOT_M
SAME_COS: Final = 0.98
"""A segment this near to another one, and this parallel, asks the same."""
AROUND_M: Final = 0.3 * FOOT_M
"""Segments up to this far off the farthest vertex may pull."""
RELAXATIONS: Final = 3
NEGLIGIBLE_M: Final = 0.01 * FOOT_M
NEGLIGIBLE_RAD: Final = 0.01
SHIFTS: Final = (-0.3, 0.0, 0.3)
"""Where on a side the segment is laid, from its middle, in lengths of the side."""
READINGS_MIN: Final = 8
TRIAL_READINGS: Final = 80
"""A trial weighs this many readings at most: it only has to be likelier than the other trials."""
TRIAL_STEP_M: Final = 0.2 * FOOT_M
TRIAL_ROUNDS: Final = 8
TRIAL_MIN: Final = 15.0
"""The best trial must have this much evidence, nat."""
FINE_STEP_M: Final = 0.1 * FOOT_M
FINE_ROUNDS: Final = 10
HITS_MIN: Final = 6.0
WHOLE: Final = 0.9
"""A track that explains this share of what is near stands where it is …"""
APART_WHOLE: Final = 1.5
APART: Final = 0.5
"""… and nothing like it is begun this near, in inner radii; any other one gives way sooner."""
CHALLENGE_DIRTY: Final = 8
"""A challenger is worth so many unseen readings."""


@kernel
def pgather(s: State, p: Settings, model: int, cx: float, cy: float) -> int:
    """Copy to `s.pw` what the sensors remember that bears on a polygon at (cx, cy); return how many.

    Where that is more than there is room for, it is thinned out evenly: the sensors lie there one after another.
    """
    n = collect(
        s.hist, s.hn, cx, cy, p.bound[model], p.cos_half, math.sin(p.half_angle), p.gate, p.pair_max, s.w
    )  # fmt: skip
    kept = min(n, s.pw.shape[0])
    for j in range(kept):
        for z in range(5):
            s.pw[j, z] = s.w[j * n // kept, z]
    return int(kept)


@kernel
def taken_by(s: State, p: Settings, model: int, x: float, y: float) -> int:
    """Return which track of the same model stands at (x, y) already, −1 if none does."""
    for t in range(s.pi.shape[0]):
        if s.pi[t, ST] != FREE and s.pi[t, MODEL] == model:
            is_whole = s.pi[t, ST] == ESTABLISHED and s.pf[t, PHITS] > WHOLE * s.pf[t, PNEAR]
            apart = (APART_WHOLE if is_whole else APART) * p.inner[model]
            if math.hypot(x - s.pf[t, PX], y - s.pf[t, PY]) < apart:
                return int(t)
    return -1


@kernel
def relax_polygon(s: State, p: Settings, model: int, sides: int) -> None:
    """Move the hypothesis in `s.pose` by the paper's relaxation (§3.4): the map pulls its first `sides` sides."""
    near = map_near(s.pose[0], s.pose[1], p.bound[model] + AROUND_M, CELL_M, s.tags, s.fill, s.store, s.near)
    pulling = min(near, PULLING)
    for j in range(pulling):
        let_pull(s.near[j], s.pull[j])
    relax(
        p.psides[model, :sides], s.pull, s.all_pull[:pulling], GAMMA, NEGLIGIBLE_M, NEGLIGIBLE_RAD, RELAXATIONS,
        s.pose,
    )  # fmt: skip


@kernel
def lay_side(
    s: State, p: Settings, model: int, k: int, shift: float, sx: float, sy: float, nx: float, ny: float
) -> None:
    """Set `s.pose` so that side `k`, `shift` lengths off its middle, lies on a segment and looks against (nx, ny)."""
    k2 = (k + 1) % p.nv[model]
    tx = p.verts[model, k2, 0] - p.verts[model, k, 0]
    ty = p.verts[model, k2, 1] - p.verts[model, k, 1]
    x = 0.5 * (p.verts[model, k, 0] + p.verts[model, k2, 0]) + shift * tx
    y = 0.5 * (p.verts[model, k, 1] + p.verts[model, k2, 1]) + shift * ty
    theta = math.atan2(-ny, -nx) - math.atan2(-tx, ty)
    c = math.cos(theta)
    sn = math.sin(theta)
    s.pose[0] = sx - (c * x - sn * y)
    s.pose[1] = sy - (sn * x + c * y)
    s.pose[2] = theta


@kernel
def begin_polygon(s: State, model: int, x: float, y: float, theta: float, llr: float) -> None:
    """Found a tentative track on the job's readings, where there is room."""
    t = free_track(s.pi, s.pf[:, PLLR], s.names[s.ti.shape[0] :])
    if t >= 0:
        begin_polygon_at(s, t, model, x, y, theta, s.pw, s.job[HEARD])
        s.pf[t, PLLR] = llr
        give_number(s.names, s.tally, s.ti.shape[0] + t)


@kernel
def begin_polygon_at(
    s: State, t: int, model: int, x: float, y: float, theta: float, w: Floats, n: int
) -> None:  # fmt: skip
    """Make track `t` a tentative one on `n` readings in `w`."""
    s.pi[t, :] = 0
    s.pf[t, :] = 0.0
    s.pbn[t, :] = 0
    s.pi[t, ST] = TENTATIVE
    s.pi[t, MODEL] = model
    s.pi[t, DIRTY] = n
    s.pf[t, PX] = x
    s.pf[t, PY] = y
    s.pf[t, PTH] = theta
    for j in range(n):
        put(s.pbins, s.pbn, t, x, y, w[j])


@kernel
def challenge(s: State, t: int, x: float, y: float, theta: float) -> None:
    """Have track `t` try a pose on its own readings: its place is right, and its pose perhaps is not."""
    s.pi[t, RIVAL] = 1
    s.pi[t, DIRTY] += CHALLENGE_DIRTY
    s.pf[t, CX] = x
    s.pf[t, CY] = y
    s.pf[t, CTH] = theta


@kernel
def ask_for_polygon(s: State, model: int, sx: float, sy: float, nx: float, ny: float) -> int:
    """Note that a polygon shall be tried behind a segment; return 1, or 0 where that has been asked of late.

    Parameters
    ----------
    s
        Memory, updated.
    model : int
        Which polygon.
    sx, sy, nx, ny : float
        The segment's middle (m) and unit normal, away from the sensors.
    """
    for k in range(min(s.job[QUESTIONS], s.asked.shape[0])):
        ask = s.asked[k]
        if ask[0] == model and math.hypot(sx - ask[1], sy - ask[2]) < SAME_M and nx * ask[3] + ny * ask[4] > SAME_COS:
            return 0
    ask = s.asked[s.job[QUESTIONS] % s.asked.shape[0]]
    ask[0] = model
    ask[1] = sx
    ask[2] = sy
    ask[3] = nx
    ask[4] = ny
    ask[5] = 0.0
    s.job[QUESTIONS] += 1
    return 1


@kernel
def next_birth(s: State) -> bool:
    """Begin with the newest segment that waits; return whether one did."""
    for back in range(1, min(s.job[QUESTIONS], s.asked.shape[0]) + 1):
        ask = s.asked[(s.job[QUESTIONS] - back) % s.asked.shape[0]]
        if ask[5] == 0.0:
            ask[5] = 1.0
            s.job[JOB] = BIRTH
            s.job[STAGE] = LAY
            s.job[WHO] = int(ask[0])
            s.job[NEXT] = 0
            s.job[HISS] = int(s.g[NOISE])
            s.work[FOUND_LLR] = -math.inf
            for z in range(4):
                s.work[SEGMENT + z] = ask[1 + z]
            return True
    return False


@kernel
def ways_to_lie(p: Settings, model: int) -> int:
    """Return how many sides of a model can lie on a segment and look different, either face of an open one's."""
    if p.closed[model] > 0:
        return max(1, int(p.nv[model] // p.sym[model]))
    return int(2 * (p.nv[model] - 1))


@kernel
def lay_next(s: State, p: Settings) -> int:
    """Lay the next side on the segment and set out from there, or from the best of all; return what that cost."""
    model = s.job[WHO]
    sides = p.nv[model] if p.closed[model] > 0 else p.nv[model] - 1
    seg = s.work[SEGMENT : SEGMENT + 4]
    k = s.job[NEXT] // len(SHIFTS)
    if k >= ways_to_lie(p, model):
        if s.work[FOUND_LLR] < TRIAL_MIN:
            end_job(s)
            return 1
        s.job[HEARD] = pgather(s, p, model, s.work[FOUND], s.work[FOUND + 1])
        seek(s, s.work[FOUND], s.work[FOUND + 1], s.work[FOUND + 2], FINE_STEP_M, FINE_ROUNDS, s.pw.shape[0])
        s.job[STAGE] = FINE
        return GATHERING
    shift = SHIFTS[s.job[NEXT] % len(SHIFTS)]
    hand = 1.0 if k < sides else -1.0
    lay_side(s, p, model, k % sides, shift, seg[0], seg[1], hand * seg[2], hand * seg[3])
    s.job[NEXT] += 1
    if shift == 0.0:
        relax_polygon(s, p, model, sides)
    s.job[HEARD] = pgather(s, p, model, s.pose[0], s.pose[1])
    if s.job[HEARD] >= READINGS_MIN:
        seek(s, s.pose[0], s.pose[1], s.pose[2], TRIAL_STEP_M, TRIAL_ROUNDS, TRIAL_READINGS)
        s.job[STAGE] = TRY
    return GATHERING


@kernel
def try_polygon(s: State, p: Settings, left: int) -> int:
    """Go on with a birth for what is left of a quantum; return what that cost."""
    model = s.job[WHO]
    if s.job[STAGE] == LAY:
        return int(lay_next(s, p))
    spent = seek_on(s, p, model, left)
    if not sought(s):
        return int(spent)
    if s.job[STAGE] == TRY:
        s.job[STAGE] = LAY
        if s.work[BEST] > s.work[FOUND_LLR]:
            s.work[FOUND] = s.work[X]
            s.work[FOUND + 1] = s.work[Y]
            s.work[FOUND + 2] = s.work[THETA]
            s.work[FOUND_LLR] = s.work[BEST]
        return int(spent)
    x = s.work[X]
    y = s.work[Y]
    theta = s.work[THETA]
    llr = weigh_pose(s, p, model, x, y, theta)
    enough = llr >= p.unknown * s.stats[NEARBY] and s.stats[HIT] >= HITS_MIN
    if enough:
        t = taken_by(s, p, model, x, y)
        if t < 0:
            if not is_barred(s, x, y, POLYGON_BAR + model, llr):
                begin_polygon(s, model, x, y, theta, llr)
        else:
            challenge(s, t, x, y, theta)
    end_job(s)
    return int(spent)
