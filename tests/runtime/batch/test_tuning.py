"""The search among settings with a made-up result, and one in halls whose settings are wrong."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from bench.tuning import MODEL, recalled, write_halls
from config.errors import UserError
from config.load import load_settings
from config.study import StudyConfig, Value, VaryConfig
from runtime.batch.runs import Run
from runtime.batch.search import Asked
from runtime.batch.tuning import Tuner, half_width, trial_runs
from runtime.batch.worker import Row, run_one

GOOD, IDLE = "perception.bayes.report_probability", "perception.bayes.tracks_max"
STUDY = StudyConfig(
    scenes=("clean",),
    seeds=4,
    objectives=("f1", "mean_error_m"),
    vary=(VaryConfig(setting=GOOD, range=(0.1, 0.9)), VaryConfig(setting=IDLE, values=(10, 20, 30))),
)
HERE = Path()


class RandomSearch:
    """Draws values at random, and keeps their costs."""

    def __init__(self, varied: Sequence[VaryConfig], seed: int) -> None:
        self._varied, self._rng = varied, random.Random(seed)
        self.costs: list[tuple[int, float]] = []
        self._asked = 0

    def ask(self) -> Asked:
        self._asked += 1
        values: dict[str, Value] = {
            one.setting: self._rng.choice(one.values) if one.values else self._rng.uniform(*one.range)
            for one in self._varied
        }
        return Asked(self._asked - 1, values)

    def tell(self, number: int, cost: float) -> None:
        self.costs.append((number, cost))


class Maker:
    """Makes up the results of runs: f1 is best where one setting is 0.3, and each seed has an error of its own."""

    def __init__(self, gain: float = 1.0, seeds_of_gain: Sequence[int] = range(100)) -> None:
        self.rows: dict[str, Row] = {}
        self.made: list[Run] = []
        self._gain, self._seeds_of_gain = gain, seeds_of_gain

    def __call__(self, runs: Sequence[Run]) -> Mapping[str, Row]:
        for run in runs:
            if run.key not in self.rows:
                self.made.append(run)
                at = run.varied.get(GOOD, 0.95)
                assert isinstance(at, float)
                assert run.seed is not None
                gain = self._gain if run.seed in self._seeds_of_gain else -self._gain
                f1 = 0.9 - gain * abs(at - 0.3) + 0.001 * math.sin(7.0 * run.seed)
                self.rows[run.key] = {"key": run.key, "status": "done", "f1": f1, "mean_error_m": 0.01}
        return self.rows


def test_the_best_is_found_without_idle_changes_and_compared_on_seeds_that_were_not_searched() -> None:
    make, search = Maker(), RandomSearch(STUDY.vary, 1)
    tuned = Tuner(STUDY, HERE, make).search(search, 30)
    assert list(tuned.best.values) == [GOOD]
    assert tuned.best.values[GOOD] == pytest.approx(0.3, abs=0.05)
    assert list(tuned.dropped) == [IDLE]
    assert [number for number, _ in search.costs] == list(range(30))
    assert min(cost for _, cost in search.costs) >= tuned.best.cost
    (f1, error) = tuned.held_out
    assert (f1.objective, f1.runs, error.mean) == ("f1", 4, 0.0)
    assert f1.present == pytest.approx(0.25, abs=0.01)
    assert f1.mean == pytest.approx(f1.tuned - f1.present)
    assert f1.is_known
    held_out = [run for run in make.made if run.seed is not None and run.seed >= STUDY.seeds]
    assert {tuple(run.varied) for run in held_out} == {(), (GOOD,)}, "only the two that are compared"


def test_a_search_that_was_stopped_goes_on_to_the_same_end() -> None:
    whole, part = Maker(), Maker()
    expected = Tuner(STUDY, HERE, whole).search(RandomSearch(STUDY.vary, 2), 12)

    def stopping(runs: Sequence[Run]) -> Mapping[str, Row]:
        if len(part.made) > 30:
            raise KeyboardInterrupt
        return part(runs)

    with pytest.raises(KeyboardInterrupt):
        Tuner(STUDY, HERE, stopping).search(RandomSearch(STUDY.vary, 2), 12)
    assert Tuner(STUDY, HERE, part).search(RandomSearch(STUDY.vary, 2), 12) == expected
    assert sorted(run.key for run in part.made) == sorted(run.key for run in whole.made)


def test_a_gain_that_only_the_searched_seeds_have_is_seen() -> None:
    tuned = Tuner(STUDY, HERE, Maker(seeds_of_gain=range(4))).search(RandomSearch(STUDY.vary, 1), 12)
    assert tuned.searched[0].mean > 0.3
    assert tuned.held_out[0].mean < -0.3


def test_a_comparison_is_of_runs_that_have_the_figure_under_both_settings() -> None:
    """A seed whose figure is known under the present settings alone counts in neither mean."""
    make = Maker()

    def some(runs: Sequence[Run]) -> Mapping[str, Row]:
        found = dict(make(runs))
        for run in runs:
            if run.seed is not None:
                found[run.key] = make.rows[run.key] | {"mean_error_m": 100.0 if run.seed == STUDY.seeds else 0.125}
                if run.seed == STUDY.seeds and run.varied:
                    del found[run.key]["mean_error_m"]
        return found

    error = Tuner(STUDY, HERE, some).search(RandomSearch(STUDY.vary, 1), 5).held_out[1]
    assert (error.runs, error.present, error.tuned, error.mean) == (3, 0.125, 0.125, 0.0)


def test_where_nothing_is_better_nothing_changes() -> None:
    tuned = Tuner(STUDY, HERE, Maker(gain=-1.0)).search(RandomSearch(STUDY.vary, 1), 5)
    assert (tuned.best, tuned.held_out) == (tuned.present, [])


def test_without_a_figure_to_compare_there_is_no_search() -> None:
    def nothing(runs: Sequence[Run]) -> Mapping[str, Row]:
        return {run.key: {"key": run.key, "status": "done"} for run in runs}

    with pytest.raises(UserError, match="no result for f1"):
        Tuner(STUDY, HERE, nothing).search(RandomSearch(STUDY.vary, 1), 5)


def test_a_trial_with_a_run_that_was_given_up_is_not_the_best() -> None:
    make = Maker()

    def losing(runs: Sequence[Run]) -> Mapping[str, Row]:
        make(runs)
        return {run.key: make.rows[run.key] for run in runs if run.seed != 2 or not run.varied}

    assert Tuner(STUDY, HERE, losing).search(RandomSearch(STUDY.vary, 1), 5).best.values == {}


def test_every_third_recording_is_held_out(tmp_path: Path) -> None:
    for i in range(7):
        (tmp_path / f"{i}.csv").write_text(f"t,x,y,theta,r00\n0,0,0,0,{i}\n")
    study = StudyConfig(recordings=str(tmp_path), objectives=("objects",))
    names = [
        [Path(run.subject).stem for run in trial_runs(study, HERE, [{}], held_out=held_out)]
        for held_out in (False, True)
    ]
    assert names == [["0", "1", "3", "4", "6"], ["2", "5"]]


def test_the_interval_of_a_mean_is_students() -> None:
    known = {3: 4.303, 6: 2.571, 21: 2.086}
    for n, t in known.items():
        values = [(-1.0) ** i for i in range(n)]
        mean = sum(values) / n
        deviation = math.sqrt(sum((value - mean) ** 2 for value in values) / (n - 1))
        assert half_width(values) == pytest.approx(t * deviation / math.sqrt(n), rel=0.04)
    assert math.isinf(half_width([1.0, 2.0]))


@pytest.mark.compiled
@pytest.mark.promise("P34")
@pytest.mark.parametrize("others", [(12.0,), pytest.param((32.0, 12.0), marks=pytest.mark.soak)])
def test_a_beam_that_is_set_too_wide_is_found_without_the_truth(
    others: tuple[float, ...], tmp_path: Path, measured: Callable[[str], None]
) -> None:
    write_halls(tmp_path, load_settings("hallway").ring, range(1))
    wrong, beam = ("ring.beam_half_angle_deg=24.0",), "ring.beam_half_angle_deg"
    study = StudyConfig(
        recordings="logs", models=(MODEL,), sets=wrong, objectives=("predicted_nat",),
        vary=(VaryConfig(setting=beam, values=others),),
    )  # fmt: skip
    rows: dict[str, Any] = {}

    def make(runs: Sequence[Run]) -> Mapping[str, Row]:
        for run in runs:
            if run.key not in rows:
                rows[run.key] = run_one(run)
        return rows

    search = RandomSearch(study.vary, 1)
    tuned = Tuner(study, tmp_path, make).search(search, 4)
    assert len(rows) == 1 + len(others), "the present and the other values"
    assert tuned.best.values == {beam: 12.0}
    assert tuned.held_out == []
    assert recalled(tmp_path, wrong)["found_searched"] == 0.0
    assert recalled(tmp_path, (f"{beam}=12.0",))["found_searched"] == 8.0
    measured("a hall with a beam set too wide: 0 of 8 drums; tuned without the truth: 8 of 8")
