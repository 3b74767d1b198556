"""Hypotheses of polygons: each distinct side of a model laid on a segment that nothing explains.

As for circles the paper's relaxation moves the body onto the outline map, and the raw readings that the sensors
remember decide. Along a side, contact says little, so each side is tried shifted as well. Here is also what keeps a
polygon's readings, and how they are weighed.
"""

from __future__ import annotations

import math
from typing import Final

from perception.full.births import CELL_M
from perception.full.contact import HITS as HIT
from perception.full.contact import NEAR as NEARBY
from perception.full.pairs import map_near
from perception.full.polygon import score_poly, search
from perception.full.state import (
    DIRTY,
    ESTABLISHED,
    FREE,
    HK,
    MODEL,
    NOISE,
    PB,
    PCAP,
    PHITS,
    PLLR,
    PNEAR,
    PTH,
    PULLING,
    PX,
    PY,
    ST,
    TENTATIVE,
    Settings,
    State,
)  # fmt: skip
from perception.kernel import Floats, Ints, kernel
from perception.relaxation import relax

FOOT_M: Final = 0.3048
TWO_PI: Final = 2.0 * math.pi
ROOM: Final = 64
"""Rows of the scratch that gathering leaves free."""
AROUND_M: Final = 0.3 * FOOT_M
"""Segments up to this far off the farthest vertex may pull."""
GAMMA: Final = 2.0
"""The paper's γ."""
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
SHRINK: Final = 0.5
WHOLE: Final = 0.9
"""A track that explains this share of what is near stands where it is …"""
APART_WHOLE: Final = 1.5
APART: Final = 0.5
"""… and nothing like it is begun this near, in inner radii; any other one gives way sooner."""


@kernel
def bears(
    qx: float, qy: float, ux: float, uy: float, r: float, cx: float, cy: float, bound: float, half: float,
    gate: float, reach: float,
) -> bool:  # fmt: skip
    """Tell whether a reading says anything for or against a body within a circle.

    Parameters
    ----------
    qx, qy, ux, uy, r : float
        The reading: place (m), unit axis, range (m).
    cx, cy, bound : float
        Centre and radius of the circle, m.
    half : float
        Half the beam's opening, rad.
    gate : float
        A range that ends farther than this before the circle says nothing, m.
    reach : float
        Nor does a sensor farther off than this, m.
    """
    dx = cx - qx
    dy = cy - qy
    dot = dx * ux + dy * uy
    if dot <= 0.0:
        return False
    d = math.sqrt(dx * dx + dy * dy)
    if d > reach or r < d - bound - gate:
        return False
    if d <= bound:
        return True
    return math.acos(min(1.0, dot / d)) <= half + math.asin(bound / d)


@kernel
def pput(bins: Floats, bn: Ints, t: int, cx: float, cy: float, q: Floats) -> None:
    """Keep reading `q` (x, y, axis, range) of polygon `t` at (cx, cy); its direction's oldest makes room."""
    b = int((math.atan2(q[1] - cy, q[0] - cx) / TWO_PI + 0.5) * PB) % PB
    k = bn[t, b] % PCAP
    bn[t, b] += 1
    for z in range(5):
        bins[t, b, k, z] = q[z]


@kernel
def pflatten(s: State, t: int, w: Floats) -> int:
    """Copy all readings of polygon `t` to `w`, shape (n, 5), and return how many."""
    n = 0
    for b in range(PB):
        for k in range(min(s.pbn[t, b], PCAP)):
            for z in range(5):
                w[n, z] = s.pbins[t, b, k, z]
            n += 1
    return n


@kernel
def pgather(s: State, p: Settings, model: int, cx: float, cy: float, w: Floats) -> int:
    """Copy to `w` what the sensors remember that bears on a polygon at (cx, cy); return how many."""
    bound = p.bound[model]
    room = w.shape[0] - ROOM
    n = 0
    for i in range(s.hist.shape[0]):
        for k in range(min(s.hn[i], HK)):
            h = s.hist[i, k]
            if bears(h[0], h[1], h[2], h[3], h[4], cx, cy, bound, p.half_angle, p.gate, p.pair_max):
                if n >= room:
                    return n
                for z in range(5):
                    w[n, z] = h[z]
                n += 1
    return n


@kernel
def pscore(s: State, p: Settings, model: int, n: int, pose: Floats, step: float, rounds: int) -> float:
    """Search from `pose`, updated, on the `n` readings in `s.w`; return the log ratio there, nat."""
    return search(
        s.w, n, pose, step, SHRINK, rounds, p.verts[model], p.nv[model], p.closed[model] > 0, p.cos_opt, p.cos_in,
        p.cos_half, math.sin(p.half_angle), p.gate, p.miss, p.short, p.levels[int(s.g[NOISE])], p.per_metre, p.table,
        p.inv_step, s.stats2, s.stats,
    )  # fmt: skip


@kernel
def prestat(s: State, p: Settings, model: int, n: int, pose: Floats) -> float:
    """Return the log ratio at `pose` of the `n` readings in `s.w`, nat; `s.stats` tells the rest."""
    return score_poly(
        s.w, n, pose[0], pose[1], pose[2], p.verts[model], p.nv[model], p.closed[model] > 0, p.cos_opt, p.cos_in,
        p.cos_half, math.sin(p.half_angle), p.gate, p.miss, p.short, p.levels[int(s.g[NOISE])], p.per_metre, p.table,
        p.inv_step, s.stats2, s.stats,
    )  # fmt: skip


@kernel
def is_taken(s: State, p: Settings, model: int, x: float, y: float) -> bool:
    """Tell whether a track of the same model stands at (x, y) already."""
    for t in range(s.pi.shape[0]):
        if s.pi[t, ST] != FREE and s.pi[t, MODEL] == model:
            is_whole = s.pi[t, ST] == ESTABLISHED and s.pf[t, PHITS] > WHOLE * s.pf[t, PNEAR]
            apart = (APART_WHOLE if is_whole else APART) * p.inner[model]
            if math.hypot(x - s.pf[t, PX], y - s.pf[t, PY]) < apart:
                return True
    return False


@kernel
def relax_polygon(s: State, p: Settings, model: int, sides: int) -> None:
    """Move the hypothesis in `s.pose` by the paper's relaxation (§3.4): the map pulls its first `sides` sides."""
    near = map_near(s.pose[0], s.pose[1], p.bound[model] + AROUND_M, CELL_M, s.tags, s.fill, s.store, s.near)
    pulling = min(near, PULLING)
    for j in range(pulling):
        s.pull[j, 0] = s.near[j, 0]
        s.pull[j, 1] = s.near[j, 1]
        s.pull[j, 2] = s.near[j, 0]
        s.pull[j, 3] = s.near[j, 1]
        s.pull[j, 4] = math.atan2(s.near[j, 3], s.near[j, 2])
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
def free_polygon(s: State) -> int:
    """Return a free track, else the tentative one with the least evidence, else −1."""
    slot = -1
    worst = math.inf
    for t in range(s.pi.shape[0]):
        if s.pi[t, ST] == FREE:
            return t
        if s.pi[t, ST] == TENTATIVE and s.pf[t, PLLR] < worst:
            worst = s.pf[t, PLLR]
            slot = t
    return slot


@kernel
def begin_polygon(s: State, model: int, llr: float, n: int) -> None:
    """Found a tentative track at `s.pose` on the `n` readings in `s.w`, where there is room."""
    t = free_polygon(s)
    if t < 0:
        return
    s.pi[t, :] = 0
    s.pf[t, :] = 0.0
    s.pbn[t, :] = 0
    s.pi[t, ST] = TENTATIVE
    s.pi[t, MODEL] = model
    s.pi[t, DIRTY] = n
    s.pf[t, PX] = s.pose[0]
    s.pf[t, PY] = s.pose[1]
    s.pf[t, PTH] = s.pose[2]
    s.pf[t, PLLR] = llr
    for j in range(n):
        pput(s.pbins, s.pbn, t, s.pose[0], s.pose[1], s.w[j])


@kernel
def pbirth(s: State, p: Settings, model: int, sx: float, sy: float, nx: float, ny: float) -> int:
    """Try a polygon behind a segment; return 1 if that took work, whatever came of it.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    model : int
        Which polygon.
    sx, sy, nx, ny : float
        The segment's middle (m) and unit normal, away from the sensors.
    """
    sides = p.nv[model] if p.closed[model] > 0 else p.nv[model] - 1
    sides = max(1, sides // p.sym[model])
    best = -math.inf
    x = 0.0
    y = 0.0
    theta = 0.0
    for k in range(sides):
        for shift in SHIFTS:
            lay_side(s, p, model, k, shift, sx, sy, nx, ny)
            if is_taken(s, p, model, s.pose[0], s.pose[1]):
                return 0
            if shift == 0.0:
                relax_polygon(s, p, model, sides)
            n = pgather(s, p, model, s.pose[0], s.pose[1], s.w)
            if n < READINGS_MIN:
                continue
            v = pscore(s, p, model, min(n, TRIAL_READINGS), s.pose, TRIAL_STEP_M, TRIAL_ROUNDS)
            if v > best:
                best = v
                x = s.pose[0]
                y = s.pose[1]
                theta = s.pose[2]
    if best < TRIAL_MIN:
        return 1
    s.pose[0] = x
    s.pose[1] = y
    s.pose[2] = theta
    n = pgather(s, p, model, x, y, s.w)
    pscore(s, p, model, n, s.pose, FINE_STEP_M, FINE_ROUNDS)
    llr = prestat(s, p, model, n, s.pose)
    if llr < p.unknown * s.stats[NEARBY] or s.stats[HIT] < HITS_MIN:
        return 1
    if not is_taken(s, p, model, s.pose[0], s.pose[1]):
        begin_polygon(s, model, llr, n)
    return 1
