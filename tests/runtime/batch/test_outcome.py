"""The best, the front and the effects of a study, compared with what can be counted by hand."""

from __future__ import annotations

import itertools
import random
from typing import Any

import numpy as np
import pytest

from config.study import StudyConfig, VaryConfig
from runtime.batch.outcome import Combination, combine, pareto_front, ranked, sensitivities
from runtime.batch.runs import Run


def combination(a: float, b: float, failed: int = 0, **figures: float) -> Combination:
    return Combination({"a": a, "b": b}, 4, failed, figures)


def grid(seed: int) -> list[Combination]:
    rng = random.Random(seed)
    return [
        combination(a, b, recall=rng.randrange(5) / 4, false=rng.randrange(3)) for a in range(4) for b in range(3)
    ]


STUDY = StudyConfig(
    scenes=("clean",),
    objectives=("recall", "false"),
    vary=(VaryConfig(setting="a", values=(0, 1, 2, 3)), VaryConfig(setting="b", values=(0, 1, 2))),
)


def test_figures_are_means_over_the_runs_that_have_them() -> None:
    runs = [Run(f"{v}{k}", "world", "hall", k, "{}", varied={"a": v}) for v in (1, 2) for k in range(3)]
    rows: dict[str, Any] = {
        "10": {"status": "done", "recall": 1.0, "false": 2},
        "11": {"status": "done", "recall": 0.5, "false": 0},
        "12": {"status": "failed"},
    }
    (only,) = combine(runs, rows)
    assert (only.values, only.runs, only.failed) == ({"a": 1}, 3, 1)
    assert only.figures == {"recall": 0.75, "false": 1.0}


def test_the_best_fails_least_then_counts_the_objectives_in_order() -> None:
    worst, unknown, good, best = (
        combination(0, 0, failed=1, recall=1.0, false=0.0),
        combination(1, 0, false=0.0),
        combination(2, 0, recall=0.9, false=1.0),
        combination(3, 0, recall=0.9, false=0.5),
    )
    assert ranked([worst, unknown, good, best], STUDY.objectives) == [best, good, unknown, worst]


@pytest.mark.parametrize("seed", range(5))
def test_no_other_is_better_than_the_front_in_all(seed: int) -> None:
    """Compared with every pair, by the definition."""
    found = grid(seed)

    def dominates(other: Combination, one: Combination) -> bool:
        pairs = [(other.cost(name), one.cost(name)) for name in STUDY.objectives]
        return all(x <= y for x, y in pairs) and any(x < y for x, y in pairs)

    expected = [one for one in found if not any(dominates(other, one) for other in found)]
    assert pareto_front(found, STUDY.objectives) == expected
    assert expected


@pytest.mark.parametrize("seed", range(5))
def test_the_shares_are_those_of_an_analysis_of_variance(seed: int) -> None:
    """In a complete grid, the share is the correlation ratio: that of a linear fit with a free mean a value."""
    found = grid(seed)
    results = sensitivities(STUDY, found)
    for one, (objective, setting) in itertools.product(results, itertools.product(("recall", "false"), "ab")):
        if (one.objective, one.setting) != (objective, setting):
            continue
        y = np.array([c.figures[objective] for c in found])
        levels = np.array([c.values[setting] for c in found])
        design = (levels[:, None] == np.unique(levels)).astype(float)
        fit = design @ np.linalg.lstsq(design, y, rcond=None)[0]
        assert one.share == pytest.approx(np.var(fit) / np.var(y))
        assert [mean for _, mean in one.means] == pytest.approx([y[levels == v].mean() for v in np.unique(levels)])
    assert [one.objective for one in results] == ["recall", "recall", "false", "false"]
    assert all(a.share >= b.share for a, b in itertools.pairwise(results) if a.objective == b.objective)


def test_a_setting_without_a_second_value_has_no_effect() -> None:
    assert sensitivities(STUDY, [combination(0, 0, recall=1.0), combination(0, 1, recall=1.0)])[0].share == 0.0
    assert sensitivities(STUDY, [combination(0, 0, recall=1.0)]) == []
