"""The polygon job: its stage, its progress, and its cost in quanta.

A search for a polygon's pose, or for its covariance, takes thousands of predicted ranges, more than fit between two
firings. So the work is one job that stops when a quantum is spent and continues in the next. Its readings are copied
when it begins, so that all poses are scored on the same readings. This module holds what hypotheses and refinements
have in common.
"""

from __future__ import annotations

from perception.bayes.memory.elements import Pose
from perception.bayes.memory.job_records import NO_JOB
from perception.bayes.memory.polygon_parameters import READING_COST
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import StateRecord
from perception.bayes.polygons.likelihood import begin_search, continue_search, score_polygon
from perception.kernel import kernel


@kernel
def cost(readings: int, every: int, sides: int) -> int:
    """Return the cost of scoring one pose, in the unit of `QUANTUM_COST`.

    Parameters
    ----------
    readings : int
        Number of readings.
    every : int
        Step from one scored reading to the next.
    sides : int
        Number of the model's sides.
    """
    return (readings + every - 1) // every * (READING_COST + sides)


@kernel
def copy_pose(source: Pose, target: Pose) -> None:
    """Copy a pose."""
    target.x = source.x
    target.y = source.y
    target.heading = source.heading


@kernel
def start_search(s: StateRecord, x: float, y: float, heading: float, step_m: float, rounds: int, most: int) -> None:
    """Begin a pose search on at most `most` of the job's readings.

    Parameters
    ----------
    s : (1,) State
        Memory, updated.
    x, y, heading, step_m, rounds
        As for `likelihood.begin_search`.
    most : int
        Readings.
    """
    job = s[0].job
    begin_search(job.search, x, y, heading, step_m, rounds)
    job.reading_step = max(1, (job.reading_count + most - 1) // most)


@kernel
def is_search_over(s: StateRecord) -> bool:
    """Return whether the job's search is over."""
    return s[0].job.search.rounds_left == 0


@kernel
def advance_search(s: StateRecord, p: SettingsRecord, model: int, left: int) -> int:
    """Continue the job's search for the rest of a quantum, at least one pose; return the cost.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    model : int
        Which polygon.
    left : int
        What is left of the quantum.
    """
    job = s[0].job
    outline = p[0].polygons[model]
    sides = outline.sides[: outline.side_count]
    each = max(1, cost(job.reading_count, job.reading_step, len(sides)))
    poses = continue_search(
        job.search,
        max(1, left // each),
        s[0].job_readings[: job.reading_count],
        job.reading_step,
        sides,
        outline.is_closed > 0,
        p,
        job.noise_level,
        s[0].scratch.score,
    )
    return poses * each


@kernel
def keep_best(s: StateRecord) -> None:
    """Store the search's pose as the job's best, with its evidence."""
    job = s[0].job
    job.best.x = job.search.x
    job.best.y = job.search.y
    job.best.heading = job.search.heading
    job.best_nat = job.search.log_likelihood_ratio


@kernel
def score_pose(s: StateRecord, p: SettingsRecord, model: int, x: float, y: float, heading: float) -> float:
    """Return the log ratio (nat) of all the job's readings at a pose; write the scratch's score.

    Parameters
    ----------
    s, p, model
        As for `advance_search`.
    x, y, heading : float
        The pose, m, rad.
    """
    outline = p[0].polygons[model]
    return score_polygon(
        s[0].job_readings[: s[0].job.reading_count],
        1,
        (x, y, heading),
        outline.sides[: outline.side_count],
        outline.is_closed > 0,
        p,
        s[0].job.noise_level,
        s[0].scratch.score,
    )


@kernel
def end_job(s: StateRecord) -> None:
    """End the job."""
    s[0].job.kind = NO_JOB
