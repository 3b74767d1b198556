"""One piece of work on polygons at a time, in quanta: what is being done, how far it has come, and what it costs.

To look for a polygon's pose, or for how well it is known, takes thousands of predicted ranges, more than fits
between two firings. So the work is a job that stops wherever a quantum is spent and goes on from there; its readings
are copied when it begins, so that all that it compares is weighed on the same ones. Here is what jobs of both kinds
are made of: the births' and the tracks'.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.polygon_likelihood import LEFT, Ear, begin_search, score_poly, search
from perception.bayes.state import Settings, State
from perception.kernel import kernel

QUANTUM: Final = 22_000
"""What a quantum may cost: sides asked for a range, and what takes as long."""
A_READING: Final = 3
"""What a reading costs, in sides, besides the model's own."""

# Cells of `State.job`: which kind of job, its stage, its track or model, its readings, the step between those that a
# search weighs, the noise believed when it began, where a stage has come to, lattices laid, births and refinements
# taken in turn, segments ever asked about; from `SEARCHING` on the counts of the search.
JOB, STAGE, WHO, HEARD, EVERY, HISS, NEXT, LAID, BY_TURNS, QUESTIONS, SEARCHING = range(11)
NO_JOB, BIRTH, TRACK = range(3)

# Cells of `State.work`: from 0 on the numbers of the search, then the best pose of several searches and its evidence,
# the segment (its middle and normal), and the lattice: its middle, its root, the evidence at its middle, its
# covariance, its mass and moments.
FOUND: Final = 5
FOUND_LLR: Final = 8
SEGMENT: Final = 9
MIDDLE: Final = 13
ROOT: Final = 16
TOP: Final = 22
COV: Final = 23
MOMENTS: Final = 29


@kernel
def ear_of(p: Settings) -> Ear:
    """Return what contact is told of the sensors."""
    return Ear(
        p.cos_opt, p.cos_in, p.cos_half, math.sin(p.half_angle), math.sqrt(1.0 - p.cos_in * p.cos_in), p.gate, p.miss,
        p.short, p.per_metre,
    )  # fmt: skip


@kernel
def sides_of(p: Settings, model: int) -> int:
    """Return how many sides a model has."""
    return int(p.nv[model] - (0 if p.closed[model] > 0 else 1))


@kernel
def cost(n: int, every: int, sides: int) -> int:
    """Return what it costs to weigh a pose: `QUANTUM` is in this currency."""
    return (n + every - 1) // every * (A_READING + sides)


@kernel
def seek(s: State, x: float, y: float, theta: float, step: float, rounds: int, most: int) -> None:
    """Set out from a pose, on at most `most` of the job's readings."""
    begin_search(s.work, s.job[SEARCHING:], x, y, theta, step, rounds)
    s.job[EVERY] = max(1, (s.job[HEARD] + most - 1) // most)


@kernel
def sought(s: State) -> bool:
    """Tell whether the search is over."""
    return bool(s.job[SEARCHING + LEFT] == 0)


@kernel
def seek_on(s: State, p: Settings, model: int, left: int) -> int:
    """Search for what is left of a quantum, one pose at least; return what that cost."""
    faces = p.faces[model, : sides_of(p, model)]
    each = max(1, cost(s.job[HEARD], s.job[EVERY], faces.shape[0]))
    poses = search(
        s.pw, s.job[HEARD], s.job[EVERY], s.work, s.job[SEARCHING:], max(1, left // each), faces, p.closed[model] > 0,
        ear_of(p), p.levels[s.job[HISS]], p.table,
        p.inv_step, s.stats,
    )  # fmt: skip
    return int(poses * each)


@kernel
def weigh_pose(s: State, p: Settings, model: int, x: float, y: float, theta: float) -> float:
    """Return the log ratio at a pose of all the job's readings, nat; `s.stats` tells the rest."""
    faces = p.faces[model, : sides_of(p, model)]
    return score_poly(
        s.pw, s.job[HEARD], 1, x, y, theta, faces, p.closed[model] > 0, ear_of(p), p.levels[s.job[HISS]], p.table,
        p.inv_step, s.stats,
    )  # fmt: skip


@kernel
def end_job(s: State) -> None:
    """Be done with it."""
    s.job[JOB] = NO_JOB
