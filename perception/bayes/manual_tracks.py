"""Tracks that a person founds or moves: a pose, the readings that bear on it, and refinement as for any other.

A hand is a decimetre or two off. The paper's relaxation takes the model onto the outline map first, as it does with a
hypothesis; from there the raw readings refine it.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.occlusion import audible
from perception.bayes.polygon_initiation import begin_polygon_at, relax_polygon
from perception.bayes.polygon_job import JOB, TRACK, WHO, end_job, sides_of
from perception.bayes.polygon_readings import collect
from perception.bayes.reservoir import flatten, gather
from perception.bayes.state import (
    C00,
    C11,
    KIND,
    MARK,
    MODEL,
    PLACED,
    PLLR,
    PX,
    PY,
    R00,
    R11,
    TRHO,
    TX,
    TY,
    Settings,
    State,
)
from perception.bayes.track_initiation import VARIANCE_MAX_M2, begin_at, begin_track, free_track, relax_onto_map
from perception.bayes.track_labels import give_number
from perception.kernel import kernel

ROUNDS: Final = 3
"""How often a model is relaxed onto the map, a few steps each."""
STRAYED_M: Final = 0.5
STRAYED_RAD: Final = 0.8
"""A relaxation that goes farther than this has found something else."""


@kernel
def settle_circle(s: State, p: Settings, kind: int, x: float, y: float) -> None:
    """Set `s.pose` to where the map draws a circle from (x, y)."""
    s.pose[0] = x
    s.pose[1] = y
    s.pose[2] = 0.0
    for _ in range(ROUNDS):
        relax_onto_map(s, p, kind)
    if math.hypot(s.pose[0] - x, s.pose[1] - y) > STRAYED_M:
        s.pose[0] = x
        s.pose[1] = y


@kernel
def say_placed(s: State, t: int) -> None:
    """Enter that a person put circle `t` there, and how well a hand knows."""
    s.tf[t, C00] = VARIANCE_MAX_M2
    s.tf[t, C11] = VARIANCE_MAX_M2
    s.tf[t, R00] = math.sqrt(VARIANCE_MAX_M2)
    s.tf[t, R11] = s.tf[t, R00]
    s.names[t, MARK] |= PLACED


@kernel
def place_circle(s: State, p: Settings, kind: int, x: float, y: float, now: float) -> int:
    """Found a track of circle `kind` about (x, y) on what the sensors remember; return it, −1 without room."""
    rho = p.radii[kind]
    settle_circle(s, p, kind, x, y)
    x = s.pose[0]
    y = s.pose[1]
    n = audible(s, p, gather(s, p, x, y, rho, s.w), x, y, rho, -1)
    t = begin_track(s, kind, rho, x, y, n, now)
    if t >= 0:
        say_placed(s, t)
    return t


@kernel
def move_circle(s: State, p: Settings, t: int, x: float, y: float, now: float) -> None:
    """Begin track `t` anew about (x, y): on its own readings, or on what the sensors remember where it is far off."""
    kind = s.ti[t, KIND]
    rho = s.tf[t, TRHO]
    settle_circle(s, p, kind, x, y)
    x = s.pose[0]
    y = s.pose[1]
    if math.hypot(x - s.tf[t, TX], y - s.tf[t, TY]) < rho + p.gate:
        n = flatten(s.bins, s.bn, t, s.w)
    else:
        n = gather(s, p, x, y, rho, s.w)
    begin_at(s, t, kind, rho, x, y, audible(s, p, n, x, y, rho, t), now)
    say_placed(s, t)


@kernel
def settle_polygon(s: State, p: Settings, model: int, x: float, y: float, theta: float) -> None:
    """Set `s.pose` to where the map draws a polygon from a pose."""
    s.pose[0] = x
    s.pose[1] = y
    s.pose[2] = theta
    for _ in range(ROUNDS):
        relax_polygon(s, p, model, sides_of(p, model))
    if math.hypot(s.pose[0] - x, s.pose[1] - y) > STRAYED_M or abs(s.pose[2] - theta) > STRAYED_RAD:
        s.pose[0] = x
        s.pose[1] = y
        s.pose[2] = theta


@kernel
def leave_job(s: State, t: int) -> None:
    """End the job at hand where it is polygon `t`'s: that is not what it was."""
    if s.job[JOB] == TRACK and s.job[WHO] == t:
        end_job(s)


@kernel
def remembered(s: State, p: Settings, model: int, x: float, y: float) -> int:
    """Copy to `s.w` what the sensors remember that bears on a polygon at (x, y); return how many."""
    return collect(
        s.hist, s.hn, x, y, p.bound[model], p.cos_half, math.sin(p.half_angle), p.gate, p.pair_max, s.w
    )  # fmt: skip


@kernel
def place_polygon(s: State, p: Settings, model: int, x: float, y: float, theta: float) -> int:
    """Found a track of a polygon about a pose on what the sensors remember; return it, −1 without room."""
    t = free_track(s.pi, s.pf[:, PLLR], s.names[s.ti.shape[0] :])
    if t >= 0:
        leave_job(s, t)
        settle_polygon(s, p, model, x, y, theta)
        n = remembered(s, p, model, s.pose[0], s.pose[1])
        begin_polygon_at(s, t, model, s.pose[0], s.pose[1], s.pose[2], s.w, n)
        row = s.ti.shape[0] + t
        give_number(s.names, s.tally, row)
        s.names[row, MARK] = PLACED
    return t


@kernel
def move_polygon(s: State, p: Settings, t: int, x: float, y: float, theta: float) -> None:
    """Begin polygon `t` anew about a pose: on its own readings, or on what the sensors remember."""
    leave_job(s, t)
    model = s.pi[t, MODEL]
    settle_polygon(s, p, model, x, y, theta)
    if math.hypot(s.pose[0] - s.pf[t, PX], s.pose[1] - s.pf[t, PY]) < p.bound[model] + p.gate:
        n = flatten(s.pbins, s.pbn, t, s.w)
    else:
        n = remembered(s, p, model, s.pose[0], s.pose[1])
    begin_polygon_at(s, t, model, s.pose[0], s.pose[1], s.pose[2], s.w, n)
    s.names[s.ti.shape[0] + t, MARK] |= PLACED
