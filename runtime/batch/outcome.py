"""What a study found: each combination of settings, the best of them, trade-offs, and what each setting changes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Final

from config.study import Objective, StudyConfig, Value
from runtime.batch.rows import FIGURES
from runtime.batch.runs import Run
from runtime.batch.worker import Row

MORE_IS_BETTER: Final = frozenset({"recall", "f1", "objects", "predicted_nat"})


@dataclass(frozen=True, slots=True)
class Combination:
    """A combination of the varied settings, and the means of its runs' figures."""

    values: Mapping[str, Value]
    runs: int
    """Finished runs."""
    failed: int
    """Drives among them that did not arrive. They have no figures, so they count before any objective."""
    figures: Mapping[str, float]
    """Mean over the runs that have the figure; those that no run has are left out."""

    def cost(self, objective: Objective) -> float:
        """Return a figure so that less is better; infinity if it is unknown."""
        value = self.figures.get(objective)
        if value is None:
            return math.inf
        return -value if objective in MORE_IS_BETTER else value


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """How an objective depends on one setting, over all values of the others."""

    setting: str
    objective: Objective
    means: tuple[tuple[Value, float], ...]
    """For each value the mean over all combinations that have it."""
    share: float
    """Share of the objective's variance over all combinations that the setting explains by itself, 0 to 1."""


def combine(runs: Iterable[Run], rows: Mapping[str, Row]) -> list[Combination]:
    """Return the combinations of the study's runs that have a finished run, in its order; `rows` are by key."""
    groups: dict[tuple[tuple[str, Value], ...], list[Row]] = {}
    for run in runs:
        if run.key in rows:
            groups.setdefault(tuple(run.varied.items()), []).append(rows[run.key])
    combinations = []
    for values, group in groups.items():
        known = {name: [row[name] for row in group if row.get(name) is not None] for name in FIGURES}
        figures = {name: fmean(numbers) for name, numbers in known.items() if numbers}
        failed = sum(row["status"] == "failed" for row in group)
        combinations.append(Combination(dict(values), len(group), failed, figures))
    return combinations


def ranked(combinations: Iterable[Combination], objectives: Sequence[Objective]) -> list[Combination]:
    """Return the combinations, the best first: by failed drives, then the first objective, then the next."""
    return sorted(combinations, key=lambda one: _costs(one, objectives))


def pareto_front(combinations: Sequence[Combination], objectives: Sequence[Objective]) -> list[Combination]:
    """Return the combinations to which no other is equal or better in everything and better in something."""
    costs = [_costs(one, objectives) for one in combinations]
    return [
        one
        for one, own in zip(combinations, costs, strict=True)
        if not any(other != own and all(a <= b for a, b in zip(other, own, strict=True)) for other in costs)
    ]


def _costs(one: Combination, objectives: Sequence[Objective]) -> tuple[float, ...]:
    return (one.failed / one.runs, *(one.cost(objective) for objective in objectives))


def sensitivities(study: StudyConfig, combinations: Sequence[Combination]) -> list[Sensitivity]:
    """Return what each varied setting changes in each objective, the greatest share of an objective first.

    The share is the main effect of an analysis of variance: the variance of the values' means, weighted by the number
    of their combinations, over that of all combinations.
    """
    found = []
    for objective in study.objectives:
        known = [one for one in combinations if objective in one.figures]
        effects = []
        for vary in study.vary:
            groups = {
                value: [one.figures[objective] for one in known if one.values[vary.setting] == value]
                for value in vary.values
            }
            means = tuple((value, fmean(numbers)) for value, numbers in groups.items() if numbers)
            if len(means) > 1:
                numbers = [one.figures[objective] for one in known]
                middle = fmean(numbers)
                total = sum((number - middle) ** 2 for number in numbers)
                between = sum(len(groups[value]) * (mean - middle) ** 2 for value, mean in means)
                share = between / total if total else 0.0
                effects.append(Sensitivity(vary.setting, objective, means, share))
        found += sorted(effects, key=lambda one: -one.share)
    return found
