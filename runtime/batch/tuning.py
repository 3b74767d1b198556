"""Tuning: search for better settings, drop the changes that bring nothing, and compare on what the search never saw.

A search asks for a batch of trials, of which each is a run with every scene, world or recording and seed, and gets
their costs in the same order, however many workers there are. As finished runs are kept, a search that was stopped
asks the same again and goes on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from statistics import NormalDist, fmean, stdev
from typing import Final, NamedTuple

from config.errors import FAILED, UserError
from config.study import Objective, StudyConfig, Value
from runtime.batch.outcome import Combination, combine
from runtime.batch.runs import Run, expand
from runtime.batch.search import Search
from runtime.batch.worker import Row

BATCH: Final = 4
"""Trials under way at a time. Constant: the course of a search must not depend on the number of workers."""
HELD_OUT_EVERY: Final = 3
"""Every third recording is not searched with, but held out for the comparison."""
NEXT_OBJECTIVE: Final = 1e-3
"""Weight of each objective over that of the one before it."""
FAILED_WEIGHT: Final = 1e3
"""Weight of the share of drives that did not arrive."""
LOSS_MAX: Final = 0.5
"""Standard errors that undoing a change may cost for it to be dropped; a loss in one run alone is a whole one."""
UNKNOWN: Final = 1.0
"""Cost of a later objective that is not known, such as the error where nothing was found."""
CONFIDENCE: Final = 0.95
ALSO_COMPARED: Final[tuple[Objective, ...]] = ("recall", "false", "mean_error_m")
"""Figures that are compared beside the objectives, where they are known."""

Values = Mapping[str, Value]
Make = Callable[[Sequence[Run]], Mapping[str, Row]]
"""Makes those runs that are not finished, and returns the rows of all that have one, by key."""


@dataclass(frozen=True, slots=True)
class Trial:
    """Values and what they cost; less is better, infinity is no result."""

    values: Values
    cost: float
    figures: Combination | None


class Difference(NamedTuple):
    """What an objective changes by, from the present settings to the tuned ones.

    All numbers are of the same runs: those of a subject and seed that have the figure under both.
    """

    objective: Objective
    present: float
    """Mean."""
    tuned: float
    runs: int
    mean: float
    half_width: float
    """Of the 95 % interval of the mean difference; infinite where there are fewer than three runs."""

    @property
    def is_known(self) -> bool:
        """Whether the difference is more than chance."""
        return abs(self.mean) > self.half_width


@dataclass(frozen=True, slots=True)
class Tuned:
    """What a search found."""

    present: Trial
    best: Trial
    """Without the changes that bring nothing."""
    trials: Sequence[Trial]
    searched: Sequence[Difference]
    """On the runs that the search was made with, which flatter the tuned settings."""
    held_out: Sequence[Difference]
    """On others; empty if there were none."""
    dropped: Values = field(default_factory=dict)
    """Changes of the best trial that brought nothing."""


def trial_runs(study: StudyConfig, base: Path, values: Sequence[Values], *, held_out: bool) -> list[Run]:
    """Return the runs with some values: those to search with, or those that are held out.

    Held out are every third recording, or as many seeds as the study has after its last one.
    """
    if study.recordings is None:
        first_seed = study.first_seed + held_out * study.seeds
        return expand(study.model_copy(update={"first_seed": first_seed}), base, values)
    runs = expand(study, base, values)
    names = sorted({run.subject for run in runs})
    others = set(names[HELD_OUT_EVERY - 1 :: HELD_OUT_EVERY])
    return [run for run in runs if (run.subject in others) == held_out]


class Tuner:
    """A search in a study with the folder `base`; `make` makes its runs."""

    def __init__(self, study: StudyConfig, base: Path, make: Make) -> None:
        self._study, self._base, self._make = study, base, make

    def search(self, search: Search, trials: int) -> Tuned:
        """Search with so many trials, and return what was found.

        Raises
        ------
        UserError
            The present settings give no figure to compare with.
        """
        (present,) = self._run_trials([{}])
        if present.figures is None:
            raise UserError("nothing to compare with: a run with the present settings ended without a result", FAILED)
        if not math.isfinite(present.cost):
            raise UserError(
                f"the present settings have no result for {self._study.objectives[0]} in every run: "
                "recordings without a truth can be tuned by predicted_nat only",
                FAILED,
            )
        tried: list[Trial] = []
        while len(tried) < trials:
            asked = [search.ask() for _ in range(min(BATCH, trials - len(tried)))]
            found = self._run_trials([one.values for one in asked])
            for one, trial in zip(asked, found, strict=True):
                search.tell(one.number, trial.cost)
            tried += found
        best = min((present, *tried), key=lambda trial: trial.cost)
        kept = self._without_idle_changes(best)
        dropped = {name: value for name, value in best.values.items() if name not in kept.values}
        held_out = self._compare(kept.values, self._runs({}, kept.values, held_out=True))
        searched = self._compare(kept.values, self._runs({}, kept.values))
        return Tuned(present, kept, tried, searched, held_out, dropped)

    def _runs(self, *values: Values, held_out: bool = False) -> list[Run]:
        return trial_runs(self._study, self._base, values, held_out=held_out)

    def _run_trials(self, values: Sequence[Values]) -> list[Trial]:
        """Run a trial for each set of values, all in one call of `make`, and return them in order.

        A trial of which any run is missing costs inf and has no figures.
        """
        each = [self._runs(one) for one in values]
        rows = self._make([run for runs in each for run in runs])
        trials = []
        for one, runs in zip(values, each, strict=True):
            complete = all(run.key in rows for run in runs)
            figures = combine(runs, rows)[0] if complete else None
            trials.append(Trial(one, math.inf if figures is None else self._cost(figures), figures))
        return trials

    def _cost(self, figures: Combination) -> float:
        """Return one number for all objectives, of which the first counts a thousand times the second."""
        first, *others = (figures.cost(objective) for objective in self._study.objectives)
        later = (NEXT_OBJECTIVE**i * (cost if math.isfinite(cost) else UNKNOWN) for i, cost in enumerate(others, 1))
        return first + sum(later) + FAILED_WEIGHT * figures.failed / figures.runs

    def _without_idle_changes(self, best: Trial) -> Trial:
        """Return the trial without the changes whose absence costs no more than half a standard error.

        The error is that of the difference between the same runs, and the cost is always compared with that of the
        best trial, so that many small losses do not add up.
        """
        kept = best
        for name in best.values:
            (without,) = self._run_trials([{other: value for other, value in kept.values.items() if other != name}])
            if without.cost <= best.cost or self._is_as_good(without, best):
                kept = without
        return kept

    def _is_as_good(self, one: Trial, best: Trial) -> bool:
        """Return whether a trial loses to the best at most `LOSS_MAX` standard errors; the runs of both are made."""
        if not math.isfinite(one.cost) or one.figures is None or best.figures is None:
            return False
        if one.figures.failed > best.figures.failed:
            return False
        runs = self._runs(one.values, best.values)
        first = self._study.objectives[0]
        differences = [after - before for before, after in _paired(runs, self._make(runs), first, best.values)]
        loss = one.figures.cost(first) - best.figures.cost(first)
        return len(differences) > 1 and loss <= LOSS_MAX * stdev(differences) / math.sqrt(len(differences))

    def _compare(self, tuned: Values, runs: Sequence[Run]) -> list[Difference]:
        """Return what each objective changes by in runs with the present settings and with the tuned ones."""
        if not runs or not tuned:
            return []
        rows, differences = self._make(runs), list[Difference]()
        for objective in dict.fromkeys((*self._study.objectives, *ALSO_COMPARED)):
            pairs = _paired(runs, rows, objective, tuned)
            if pairs:
                before, after = (fmean(values) for values in zip(*pairs, strict=True))
                gains = [with_tuned - as_now for as_now, with_tuned in pairs]
                row = (before, after, len(gains), fmean(gains), half_width(gains))
                differences.append(Difference(objective, *row))
        return differences


def _paired(
    runs: Sequence[Run], rows: Mapping[str, Row], objective: Objective, to: Values
) -> list[tuple[float, float]]:
    """Return an objective in the two runs of each subject and seed: with other values, and with the values `to`."""
    found: dict[tuple[str, int | None], dict[bool, float]] = {}
    for run in runs:
        value = rows.get(run.key, {}).get(objective)
        if value is not None:
            found.setdefault((run.subject, run.seed), {})[run.varied == to] = value
    return [(pair[False], pair[True]) for pair in found.values() if len(pair) > 1]


def half_width(differences: Sequence[float]) -> float:
    """Return half the width of the 95 % interval of a mean, by Student's t; infinity for fewer than three values.

    The quantile is approximated from that of the normal distribution, to 3 % for three values and better for more
    (Abramowitz & Stegun 26.7.5).
    """
    n = len(differences)
    if n < 3:
        return math.inf
    z, v = NormalDist().inv_cdf(0.5 + 0.5 * CONFIDENCE), n - 1
    t = z + (z**3 + z) / (4 * v) + (5 * z**5 + 16 * z**3 + 3 * z) / (96 * v**2)
    t += (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / (384 * v**3)
    return t * stdev(differences) / math.sqrt(n)
