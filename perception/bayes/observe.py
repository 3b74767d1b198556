"""One firing, taken in: who explains each reading, who keeps it, and what the unexplained ones propose.

This is what runs always, at a cost that depends on the ring and on how many objects there are room for, and on
nothing that has been before.
"""

from __future__ import annotations

import math
from typing import Final

from config.units import FOOT_M
from perception.bayes.noise_estimation import choose_noise, noise_variance, reach_of, roughness
from perception.bayes.polygon_association import poly_claims
from perception.bayes.polygon_initiation import ask_for_polygon
from perception.bayes.range_fit import FAR
from perception.bayes.reservoir import put
from perception.bayes.segment_pairs import SEG, map_add, tangent
from perception.bayes.state import (
    DIRTY,
    ESTABLISHED,
    FREE,
    HERE_X,
    HERE_Y,
    HK,
    KIND,
    POLISH,
    QUIET,
    R00,
    SEGMENTS,
    ST,
    STAMP,
    STAMP_S,
    STAMPED,
    TENTATIVE,
    TRHO,
    TX,
    TY,
    Settings,
    State,
)  # fmt: skip
from perception.bayes.track_initiation import CELL_M, birth
from perception.bayes.track_selection import is_waiting
from perception.bayes.walls import update_lines
from perception.kernel import Floats, Ints, kernel

COORDINATE_MAX_M: Final = 0.5 * FAR
"""A place this far from the odometry's origin is none: ranges as long as this mean silence."""
STILL_M: Final = 0.05 * FOOT_M
STILL_COS: Final = 0.9998
"""A sensor that has moved less than this, turned less than this (1°), and hears what it heard has nothing to tell."""
CLAIM_ASIDE_M: Final = 0.004 * FOOT_M
KEEP_ASIDE_M: Final = 0.01 * FOOT_M
"""How far outside a beam a centre may lie for the reading to be claimed, and kept."""
BASELINE_M: Final = 0.5 * FOOT_M
"""Shortest baseline of one sensor; the next ones are twice and four times this."""
BASELINES: Final = 3
BASELINE_MAX_M: Final = 2.6 * FOOT_M
NEIGHBOUR_MIN_M: Final = 0.3 * FOOT_M
NEIGHBOUR_MAX_M: Final = 1.0 * FOOT_M
"""Baselines of neighbours that did not fire together."""
MAPPED_MIN_M: Final = 0.2 * FOOT_M
"""A shorter segment's direction is worth nothing to the relaxation."""
TRIES: Final = 2
"""Hypotheses that are worked out in a firing, at most."""


@kernel
def place_readings(
    s: State, p: Settings, mounts: Floats, px: float, py: float, yaw: float, ranges: Floats
) -> int:  # fmt: skip
    """Enter what fired into `s.cur`, in the odometry's frame, and return how many said anything new.

    A pose that is no place and a range that is no distance are left out: entered, they would stay in every sum.
    """
    if not (abs(px) < COORDINATE_MAX_M and abs(py) < COORDINATE_MAX_M and math.isfinite(yaw)):
        return 0
    c = math.cos(yaw)
    sn = math.sin(yaw)
    m = 0
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if not r >= 0.0:  # nor NaN
            continue
        if r >= p.range_max:
            r = 2.0 * FAR
        x = px + c * mounts[i, 0] - sn * mounts[i, 1]
        y = py + sn * mounts[i, 0] + c * mounts[i, 1]
        ux = math.cos(yaw + mounts[i, 2])
        uy = math.sin(yaw + mounts[i, 2])
        still = math.hypot(x - s.last[i, 0], y - s.last[i, 1]) < STILL_M
        if still and abs(r - s.last[i, 4]) <= p.half_box and ux * s.last[i, 2] + uy * s.last[i, 3] > STILL_COS:
            continue
        s.cur[m, 0] = x
        s.cur[m, 1] = y
        s.cur[m, 2] = ux
        s.cur[m, 3] = uy
        s.cur[m, 4] = r
        for z in range(5):
            s.last[i, z] = s.cur[m, z]
        s.cur[m, 5] = float(i)
        s.owner[m] = -1
        m += 1
    return m


@kernel
def claim(s: State, p: Settings, m: int) -> None:
    """Let established objects claim what they explain: the best match wins."""
    var0, rel2 = noise_variance(s, p)
    for i in range(m):
        if s.cur[i, 4] >= FAR:
            continue
        best = FAR
        for t in range(s.ti.shape[0]):
            if s.ti[t, ST] != ESTABLISHED or (p.polys > 0 and s.ti[t, KIND] >= p.models):
                continue
            dx = s.tf[t, TX] - s.cur[i, 0]
            dy = s.tf[t, TY] - s.cur[i, 1]
            dot = dx * s.cur[i, 2] + dy * s.cur[i, 3]
            d = math.sqrt(dx * dx + dy * dy)
            if dot <= 0.0 or dot < p.cos_opt * d - CLAIM_ASIDE_M:
                continue
            e = abs(s.cur[i, 4] - (d - s.tf[t, TRHO]))
            if e < best and e < reach_of(p.half_box, var0 + rel2 * d * d) + 2.0 * s.tf[t, R00]:
                best = e
                s.owner[i] = t


@kernel
def bears_on(
    q: Floats, cx: float, cy: float, rho: float, is_free: bool, is_ours: bool, cos_opt: float, cos_in: float,
    gate: float, silence_max: float,
) -> bool:  # fmt: skip
    """Tell whether a reading says anything for or against a circle.

    Parameters
    ----------
    q : (6,) float
        A row of `State.cur`.
    cx, cy, rho : float
        Centre and radius, m.
    is_free, is_ours : bool
        Whether nothing else explains it; whether a hit on this circle would be taken to be its own.
    cos_opt, cos_in, gate, silence_max
        As in `Settings`; `silence_max` is `pair_max`.
    """
    dx = cx - q[0]
    dy = cy - q[1]
    dot = dx * q[2] + dy * q[3]
    if dot <= 0.0:
        return False
    d = math.sqrt(dx * dx + dy * dy)
    if dot < cos_opt * d - KEEP_ASIDE_M:
        return False
    e = q[4] - (d - rho)
    if e < -gate:
        return is_free and dot >= cos_in * d
    if e > gate:
        return dot >= cos_in * d and d <= silence_max
    return is_ours


@kernel
def keep(s: State, p: Settings, m: int) -> None:
    """Let every object keep what bears on it."""
    for t in range(s.ti.shape[0]):
        if s.ti[t, ST] == FREE:
            continue
        s.ti[t, QUIET] += 1
        cx = s.tf[t, TX]
        cy = s.tf[t, TY]
        rho = s.tf[t, TRHO]
        for i in range(m):
            owner = s.owner[i]
            is_ours = owner == -1 or owner == t or (owner < 0 and s.ti[t, ST] != TENTATIVE)
            if bears_on(s.cur[i], cx, cy, rho, owner == -1, is_ours, p.cos_opt, p.cos_in, p.gate, p.pair_max):
                put(s.bins, s.bn, t, cx, cy, s.cur[i])
                s.ti[t, DIRTY] += 1
                s.ti[t, QUIET] = 0
                s.ti[t, POLISH] = p.polish


@kernel
def pair(i: int, q: Floats, other: Floats, cos_half: float, var: float, segs: Floats, made: int) -> int:
    """Make a segment of reading `i`, whose row is `q`, and an `other` one; return how many there are then."""
    if other[4] >= FAR or made >= segs.shape[0]:
        return made
    if not tangent(
        other[0], other[1], other[2], other[3], other[4], q[0], q[1], q[2], q[3], q[4], cos_half, var, segs[made]
    ):
        return made
    segs[made, SEG] = float(i)
    return made + 1


@kernel
def pair_in_time(
    i: int, q: Floats, memory: Floats, kept: int, now: float, gap: float, cos_half: float, var: float, segs: Floats,
    made: int,
) -> int:  # fmt: skip
    """Pair a reading with its own sensor's `memory`, at three baselines: a short one is early, a long one sure."""
    step = 0
    for back in range(min(kept, HK)):
        old = memory[(kept - 1 - back) % HK]
        if now - old[5] > gap:
            break
        base = math.hypot(q[0] - old[0], q[1] - old[1])
        if base < BASELINE_M * (1 << step):
            continue
        if base > BASELINE_MAX_M:
            break
        step += 1
        made = pair(i, q, old, cos_half, var, segs, made)
        if step == BASELINES:
            break
    return made


@kernel
def pair_in_ring(
    i: int, cur: Floats, m: int, hist: Floats, hn: Ints, now: float, gap: float, cos_half: float, var: float,
    segs: Floats, made: int,
) -> int:  # fmt: skip
    """Pair a reading with its neighbours' in the ring: of this firing, else their newest."""
    sensors = hn.shape[0]
    for side in (-1, 1):
        neighbour = (int(cur[i, 5]) + side) % sensors
        if hn[neighbour] == 0:
            continue
        fired = False
        for k in (i - 1, i + 1, 0, m - 1):
            if 0 <= k < m and int(cur[k, 5]) == neighbour:
                if side == 1:  # the other one makes the pair from its side
                    made = pair(i, cur[i], cur[k], cos_half, var, segs, made)
                fired = True
                break
        if not fired:
            old = hist[neighbour, (hn[neighbour] - 1) % HK]
            base = math.hypot(cur[i, 0] - old[0], cur[i, 1] - old[1])
            if now - old[5] < gap and NEIGHBOUR_MIN_M < base < NEIGHBOUR_MAX_M:
                made = pair(i, cur[i], old, cos_half, var, segs, made)
    return made


@kernel
def make_segments(s: State, p: Settings, m: int, now: float) -> int:
    """Pair this firing's echoes in time and in the ring; return how many segments there are, and map them."""
    var0, rel2 = noise_variance(s, p)
    made = 0
    for i in range(m):
        r = s.cur[i, 4]
        if r < FAR:
            var = var0 + rel2 * r * r
            sensor = int(s.cur[i, 5])
            made = pair_in_time(
                i, s.cur[i], s.hist[sensor], s.hn[sensor], now, p.gap, p.cos_half, var, s.segs, made
            )  # fmt: skip
            made = pair_in_ring(i, s.cur, m, s.hist, s.hn, now, p.gap, p.cos_half, var, s.segs, made)
    for k in range(made):
        if s.segs[k, 4] > MAPPED_MIN_M:
            bucket = map_add(s.segs[k], CELL_M, s.tags, s.fill, s.store)
            at = (s.fill[bucket] - 1) % s.store.shape[1]
            s.tally[STAMPED] += 1
            s.stamps[bucket, at, STAMP] = s.tally[STAMPED]
            s.stamps[bucket, at, STAMP_S] = now
    s.g[SEGMENTS] += made
    return made


@kernel
def remember(s: State, p: Settings, m: int, now: float) -> None:
    """Enter this firing into the sensors' memories, spaced out, and hear how rough it is."""
    for i in range(m):
        sensor = int(s.cur[i, 5])
        kept = s.hn[sensor]
        if kept > 0:
            old = s.hist[sensor, (kept - 1) % HK]
            near = math.hypot(s.cur[i, 0] - old[0], s.cur[i, 1] - old[1]) < p.spacing
            if near and now - old[5] < p.gap:
                continue
        if kept > 1 and s.cur[i, 4] < FAR:
            roughness(
                s.cur[i], s.hist[sensor, (kept - 1) % HK], s.hist[sensor, (kept - 2) % HK], now, p.gap, p.half_box,
                p.noises, s.ddl,
            )  # fmt: skip
        row = s.hist[sensor, kept % HK]
        for z in range(5):
            row[z] = s.cur[i, z]
        row[5] = now
        s.hn[sensor] += 1


@kernel
def propose(s: State, p: Settings, made: int, now: float) -> None:
    """Start hypotheses from what nothing explains, the surest segments first."""
    tries = 0
    for _ in range(p.attempts):
        chosen = -1
        best = p.hyp_sigma
        for k in range(made):
            i = int(s.segs[k, SEG])
            if s.owner[i] == -1 and s.cur[i, 4] <= p.pair_max:
                aside = s.segs[k, 6] * (s.cur[i, 4] + p.radii[0])
                if aside < best:
                    best = aside
                    chosen = k
        if chosen < 0:
            return
        x, y, nx, ny = s.segs[chosen, 0], s.segs[chosen, 1], s.segs[chosen, 2], s.segs[chosen, 3]
        for kind in range(max(1, p.models)):
            tries += birth(s, p, kind, x, y, nx, ny, now)
        for model in range(p.polys):
            tries += ask_for_polygon(s, model, x, y, nx, ny)
        s.owner[int(s.segs[chosen, SEG])] = -100
        if tries >= TRIES:
            return


@kernel
def observe(
    s: State,
    p: Settings,
    mounts: Floats,
    px: float,
    py: float,
    yaw: float,
    now: float,
    ranges: Floats,
    threshold: float,
) -> tuple[int, bool]:
    """Take in one firing; everything but refinement.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    mounts : (n, 3) float
        x, y (m), direction (rad) of each sensor in the ring's frame.
    px, py, yaw, now : float
        Place (m) and direction (rad) of the ring, time (s).
    ranges : (n,) float
        m; NaN did not fire, inf heard nothing.
    threshold : float
        Unseen evidence for an object's size from which on it waits for refinement.

    Returns
    -------
    (int, bool)
        Outline segments made, and whether an object waits for refinement.
    """
    m = place_readings(s, p, mounts, px, py, yaw, ranges) if math.isfinite(now) else 0
    if m > 0:
        s.g[HERE_X], s.g[HERE_Y] = px, py
    claim(s, p, m)
    if p.polys > 0:
        var0, _ = noise_variance(s, p)
        poly_claims(s, p, m, reach_of(p.half_box, var0))
    update_lines(s, p, m)
    keep(s, p, m)
    made = make_segments(s, p, m, now)
    remember(s, p, m, now)
    choose_noise(s, p)
    propose(s, p, made, now)
    return made, is_waiting(s, p, threshold)
