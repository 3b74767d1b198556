"""Where a track's pose is looked for: near by, widely, and on the other summits.

A polygon's likelihood has many of them: a face shifted along itself, a body turned by half of what makes it look
alike, or lying on another of its sides.
"""

from __future__ import annotations

import math
from typing import Final

from config.units import FOOT_M
from perception.bayes.polygon_initiation import lay_side, ways_to_lie
from perception.bayes.polygon_job import FOUND, FOUND_LLR, HEARD, MIDDLE, NEXT, STAGE, seek, sides_of
from perception.bayes.polygon_likelihood import ACROSS, ALONG, BEST, THETA, X, Y, moved
from perception.bayes.state import CTH, CX, CY, MODEL, PHITS, PNEAR, PTH, PX, PXX, PY, REFS, RIVAL, Settings, State
from perception.kernel import Floats, copy_span, kernel

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


@kernel
def search_first(s: State, t: int) -> None:
    """Set out for the pose: widely while little is known or explained, else near by, or not at all."""
    track = s.pf[t]
    refs = s.pi[t, REFS]
    is_fitting = track[PHITS] >= FITTING * track[PNEAR]
    copy_span(track, PX, 3, s.work, FOUND)
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
    faces = p.faces[model, : sides_of(p, model)]
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
