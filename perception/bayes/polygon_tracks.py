"""Tracks of polygons: the same life as the circles', with a heading.

A track is refined in stages, as a job that a quantum takes on by a step: its readings are dealt out, its pose is
looked for, judged, and placed. Its likelihood's top is flat, because ranges are rounded: the pose is the middle of
the plateau and the plateau's width is what is not known.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.object_report import POLYGON_PROBABILITY, is_sure_polygon
from perception.bayes.polygon_alternatives import compare_circles, is_wall
from perception.bayes.polygon_association import OVERLAP, leave_to_next_neighbour
from perception.bayes.polygon_initiation import next_birth, try_polygon
from perception.bayes.polygon_job import (
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
    end_job,
    seek_on,
    sides_of,
    sought,
    weigh_pose,
)
from perception.bayes.polygon_likelihood import BEST, SURE
from perception.bayes.polygon_posterior import ATTEMPTS, begin_lattice, lattice_on
from perception.bayes.pose_restarts import (
    DEAL,
    FITTING,
    JUDGE,
    LOOK_NEAR,
    LOOK_WIDE,
    SPREAD,
    THROW,
    THROW_GAIN,
    keep_found,
    search_first,
    throw_next,
)
from perception.bayes.range_fit import HITS as HIT
from perception.bayes.range_fit import NEAR as NEARBY
from perception.bayes.reservoir import flatten
from perception.bayes.state import (
    CONFIRMED,
    DIRTY,
    ESTABLISHED,
    FREE,
    MARK,
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
    ST,
    TENTATIVE,
    Settings,
    State,
)
from perception.bayes.track_labels import give_up, outlives
from perception.bayes.track_selection import choose_polygon
from perception.kernel import copy_span, kernel

EVIDENCE_MIN: Final = 5.0
UNKNOWN_LEAD: Final = 8.0
"""Evidence below the first, or behind an unknown thing's by the second, is the end, nat."""
ESTABLISH: Final = 0.9
ESTABLISH_HITS: Final = 10.0
ESTABLISH_SURE: Final = 3.0
MANY_HITS: Final = 20.0
MANY_SURE: Final = 2.0
"""A track is established by so many hits, and so many that had to be: corners alone fit anywhere."""
DOUBT: Final = 0.3
DOUBT_SHARE: Final = 0.75
"""One less probable, or that explains less of what is near, is in doubt."""
TWIN: Final = 0.4
"""Two bodies whose centres are nearer than this, in inner radii, are one."""


@kernel
def judge(s: State, p: Settings, t: int) -> None:
    """Establish track `t`, doubt it or end it; what is not placed yet is established once it is."""
    track = s.pf[t]
    if track[PLLR] < EVIDENCE_MIN or track[PLLR] < p.unknown_poly * track[PNEAR] - UNKNOWN_LEAD:
        give_up(s.pi, s.names, t, s.ti.shape[0] + t)
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
    """Leave one body in a place: twins merge, and of overlapping ones an established and likelier one stands.

    One that a person spoke of stands in any case.
    """
    inner = p.inner[s.pi[t, MODEL]]
    row = s.ti.shape[0]
    for k in range(s.pi.shape[0]):
        if k == t or s.pi[k, ST] == FREE:
            continue
        d = math.hypot(s.pf[k, PX] - s.pf[t, PX], s.pf[k, PY] - s.pf[t, PY])
        is_twin = d < TWIN * inner
        if not is_twin and d >= OVERLAP * inner:
            continue
        has_more = s.pf[k, PLLR] > s.pf[t, PLLR]
        spoken_of = s.names[row + t, MARK] != 0 or s.names[row + k, MARK] != 0
        if is_twin or spoken_of:
            has_more = outlives(s.names, row + k, row + t, has_more)
        if has_more:
            if is_twin or spoken_of or s.pi[k, ST] == ESTABLISHED:
                s.pi[t, ST] = FREE
                return
        elif is_twin or spoken_of or s.pi[t, ST] == ESTABLISHED:
            s.pi[k, ST] = FREE


@kernel
def next_track(s: State, p: Settings, threshold: float) -> bool:
    """Begin with the polygon whose turn it is; return whether there is one.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    threshold : float
        Less than this share of unseen evidence is not worth the work.
    """
    chosen = choose_polygon(s, p, threshold)
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
    s.job[HEARD] = flatten(s.pbins, s.pbn, chosen, s.pw)
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
    row = s.ti.shape[0] + t
    if is_wall(s, p, t) and give_up(s.pi, s.names, t, row):
        return
    compare_circles(s, p, t)
    judge(s, p, t)
    least = min(p.report, POLYGON_PROBABILITY)
    if s.names[row, MARK] > CONFIRMED and is_sure_polygon(s.pi, s.pf, s.pbn, s.pbins, least, t):
        s.names[row, MARK] &= CONFIRMED
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
                copy_span(s.work, FOUND, 3, s.work, MIDDLE)
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
        return cost((1 + p.radii.shape[0]) * s.job[HEARD], 1, sides_of(p, model))
    spent = lattice_on(s, p, model, left)
    if s.job[LAID] == ATTEMPTS:
        copy_span(s.work, MIDDLE, 3, s.pf[t], PX)
        copy_span(s.work, COV, 6, s.pf[t], PXX)
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
