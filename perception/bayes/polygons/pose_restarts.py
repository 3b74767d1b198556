"""Searches for a polygon track's pose: near by, wide, and restarts at other maxima.

A polygon's likelihood has many maxima: a face shifted along itself, a body turned by half of its symmetry's angle, or
lying on another of its sides.
"""

from __future__ import annotations

import math

from perception.bayes.memory.job_records import ACROSS, ALONG, JUDGE, SEARCH_NEAR, SEARCH_WIDE
from perception.bayes.memory.polygon_parameters import (
    COARSE_READINGS,
    FINE_STEP_M,
    FITTING_SHARE,
    NARROW_ROUNDS,
    NARROW_STEP_M,
    RESTART_ROLLS_MAX,
    RESTART_ROUNDS,
    RESTART_SHIFTS,
    RESTART_TURNS,
    SEARCH_EVERY,
    WIDE_ROUNDS,
    WIDE_SEARCH_EVERY,
    WIDE_SEARCHES_FIRST,
    WIDE_STEP_M,
)
from perception.bayes.memory.settings_record import PolygonSide, SettingsRecord
from perception.bayes.memory.state import StateRecord
from perception.bayes.polygons.initiation import lay_side, ways_to_lie
from perception.bayes.polygons.job import start_search
from perception.bayes.polygons.likelihood import moved
from perception.kernel import kernel
from perception.records import Records


@kernel
def begin_pose_search(s: StateRecord, t: int) -> None:
    """Begin a search for a track's pose: wide while little is known or explained, else near by, or none."""
    track = s[0].polygons[t]
    job = s[0].job
    count = track.refinements
    is_fitting = track.hits >= FITTING_SHARE * track.near
    job.best.x = track.x
    job.best.y = track.y
    job.best.heading = track.heading
    if (
        count < WIDE_SEARCHES_FIRST
        or count % WIDE_SEARCH_EVERY == 0
        or track.has_challenger > 0
        or (not is_fitting and count % 2 == 0)
    ):
        start_search(s, track.x, track.y, track.heading, WIDE_STEP_M, WIDE_ROUNDS, COARSE_READINGS)
        job.stage = SEARCH_WIDE
    elif track.covariance.xx > 0.0 and is_fitting and count % SEARCH_EVERY != 0:
        job.stage = JUDGE  # the lattice moves to the pose without a search
    else:
        search_near(s)


@kernel
def search_near(s: StateRecord) -> None:
    """Begin a search from the best pose, on all readings."""
    best = s[0].job.best
    start_search(s, best.x, best.y, best.heading, NARROW_STEP_M, NARROW_ROUNDS, len(s[0].job_readings))
    s[0].job.stage = SEARCH_NEAR


@kernel
def facing_side(s: StateRecord, sides: Records[PolygonSide], is_closed: bool) -> tuple[int, float]:
    """Return the side that faces the job's readings most, at the pose of the job's middle, and its face, ±1.

    The face is −1 where the readings are on the inner side of an open outline.
    """
    job = s[0].job
    n = job.reading_count
    x = 0.0
    y = 0.0
    for j in range(n):
        x += s[0].job_readings[j].x / n
        y += s[0].job_readings[j].y / n
    dx = x - job.middle.x
    dy = y - job.middle.y
    c = math.cos(job.middle.heading)
    sn = math.sin(job.middle.heading)
    bx = c * dx + sn * dy
    by = -sn * dx + c * dy
    best = -math.inf
    side = 0
    face = 1.0
    for k in range(len(sides)):
        it = sides[k]
        mx = bx - it.x - 0.5 * it.length * it.tangent_x
        my = by - it.y - 0.5 * it.length * it.tangent_y
        v = (mx * it.tangent_y - my * it.tangent_x) / math.hypot(mx, my)
        if (v if is_closed else abs(v)) > best:
            best = v if is_closed else abs(v)
            side = k
            face = 1.0 if v >= 0.0 else -1.0
    return side, face


@kernel
def roll(s: StateRecord, p: SettingsRecord, model: int, k: int) -> bool:
    """Roll the pose at the job's middle onto its `k`-th other side; return whether there is such a side.

    Parameters
    ----------
    s, p
        Memory, whose scratch takes the pose as its `hypothesis`, and settings.
    model : int
        Which polygon.
    k : int
        From 1 on.
    """
    middle = s[0].job.middle
    outline = p[0].polygons[model]
    sides = outline.sides[: outline.side_count]
    ways = ways_to_lie(p, model)
    if k >= min(ways, RESTART_ROLLS_MAX + 1):
        return False
    side, face = facing_side(s, sides, outline.is_closed > 0)
    c = math.cos(middle.heading)
    sn = math.sin(middle.heading)
    f = sides[side]
    x = f.x + 0.5 * f.length * f.tangent_x
    y = f.y + 0.5 * f.length * f.tangent_y
    nx = -face * f.tangent_y
    ny = face * f.tangent_x
    # alternately the sides before and after
    turned = ((k + 1) // 2 if k % 2 == 1 else ways - k // 2) + (side if face > 0.0 else side + len(sides))
    turned %= ways
    flip = 1.0 if turned < len(sides) else -1.0
    lay_side(
        s,
        p,
        model,
        turned % len(sides),
        0.0,
        middle.x + c * x - sn * y,
        middle.y + sn * x + c * y,
        flip * (c * nx - sn * ny),
        flip * (sn * nx + c * ny),
    )
    return True


@kernel
def next_restart(s: StateRecord, p: SettingsRecord, t: int) -> None:
    """Begin the search at the next other maximum around the first one found; else search near the best.

    Restarts are the pose shifted along and across, turned, rolled onto its other sides, and the challenger's pose.
    """
    track = s[0].polygons[t]
    middle = s[0].job.middle
    model = track.model
    k = s[0].job.next_step
    s[0].job.next_step += 1
    shifts = 2 * len(RESTART_SHIFTS)
    turns = shifts + len(RESTART_TURNS)
    x, y, heading = middle.x, middle.y, middle.heading
    if k < shifts:
        # both ways along, then both ways across, first near, then far
        step = RESTART_SHIFTS[2 * (k // 4) + k % 2] * p[0].polygons[model].inner_radius_m
        x, y, heading = moved(x, y, heading, ALONG if k % 4 < 2 else ACROSS, step)
    elif k < turns:
        heading += RESTART_TURNS[k - shifts] * math.pi / p[0].polygons[model].symmetry
    elif roll(s, p, model, k - turns + 1):
        rolled = s[0].scratch.hypothesis
        x, y, heading = rolled.x, rolled.y, rolled.heading
    elif track.has_challenger > 0:
        track.has_challenger = 0
        x, y, heading = track.challenger.x, track.challenger.y, track.challenger.heading
    else:
        search_near(s)
        return
    start_search(s, x, y, heading, FINE_STEP_M, RESTART_ROUNDS, COARSE_READINGS)
