"""Perception keeps to its budget, and with less of it the answers come later and are no worse in the end.

In counted quanta, exactly; in processor time, the short form of what `make soak` does.
"""

from __future__ import annotations

import json
import subprocess
import sys
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from config.errors import DONE, WRONG_CALL
from config.load import load_settings
from runtime.cli.app import run_command
from runtime.cycle.step import CycleRecord
from runtime.simulation.budget_sweep import BudgetRow, drive, long_hall_settings
from runtime.simulation.closed_loop import simulate
from runtime.simulation.long_hall import A_SIDE, long_hall
from runtime.timing.refinement_budget import CpuTimeBudget, QuantumBudget, RefinementBudget

ROOT = Path(__file__).parents[2]
CYCLES = 3000
SETTINGS = long_hall_settings(load_settings("irregular"))


def asked(refinement_budget: RefinementBudget, cycles: int) -> list[int]:
    """Return how many quanta each cycle gets where there is no end of work."""
    counts = []
    for _ in range(cycles):
        refinement_budget.begin()
        done = 0
        while refinement_budget(done):
            done += 1
        counts.append(done)
    return counts


def test_quanta_are_counted_by_the_cycle() -> None:
    assert asked(QuantumBudget(3), 3) == [3, 3, 3]
    assert asked(QuantumBudget(0.25), 9) == [0, 0, 0, 1, 0, 0, 0, 1, 0]
    assert asked(QuantumBudget(0), 3) == [0, 0, 0]


def test_what_is_not_used_is_not_saved_up() -> None:
    refinement_budget = QuantumBudget(2)
    for _ in range(5):
        refinement_budget.begin()
    assert asked(refinement_budget, 1) == [2]


def test_processor_time_begins_anew_each_cycle() -> None:
    spent_s = 0.0

    def clock() -> float:
        nonlocal spent_s
        spent_s += 0.001  # a quantum between two looks
        return spent_s

    assert asked(CpuTimeBudget(0.0035, clock), 3) == [3, 3, 3]
    assert asked(CpuTimeBudget(0.0, clock), 2) == [0, 0]


def test_the_long_hall_holds_forty_drums_that_stand_apart() -> None:
    for seed in range(20):
        drums = long_hall(seed).drum
        assert len(drums) == 2 * A_SIDE == 40
        for i, a in enumerate(drums):
            for b in drums[:i]:
                assert (a.x_m - b.x_m) ** 2 + (a.y_m - b.y_m) ** 2 > (a.radius_m + b.radius_m) ** 2
    assert long_hall(1) == long_hall(1) != long_hall(2)


@pytest.mark.compiled
def test_tracks_are_not_used_up_in_the_long_hall() -> None:
    world = long_hall(0)
    held: list[int] = []

    def on_cycle(record: CycleRecord, _truth: object) -> None:
        held.append(record.clusters)

    simulate(SETTINGS, world, 0, 600.0, on_cycle)
    assert max(held) < SETTINGS.perception.bayes.tracks_max, max(held)


@pytest.mark.compiled
def test_the_record_says_how_many_quanta_ran_and_why_no_more() -> None:
    """With one quantum a firing the rest waits for the next firing; with one a cycle it waits for the next cycle."""
    settings = load_settings("hallway")
    assert settings.world is not None
    records: list[CycleRecord] = []
    for refinement_budget in (QuantumBudget(50), QuantumBudget(0.5)):
        simulate(
            settings,
            settings.world,
            0,
            15.0,
            lambda record, _truth: records.append(record),
            refinement_budget=refinement_budget,
        )
    quanta: dict[str, set[int]] = {}
    for record in records:
        quanta.setdefault(record.refinement, set()).add(record.quanta)
    assert quanta == {"nothing": {0}, "converged": {1, 2}, "quota": {2}, "budget": {0, 1}}


@pytest.fixture(scope="module")
def sweep() -> dict[float, BudgetRow]:
    """Return a drive under each of several budgets in counted quanta."""
    return {most: drive(SETTINGS, most, partial(QuantumBudget, most), (0,)) for most in (0.25, 1, 2, 50)}


@pytest.mark.compiled
def test_smaller_budgets_give_later_answers(sweep: dict[float, BudgetRow]) -> None:
    ways = [sweep[most]["way_m"] or 0.0 for most in (0.25, 1, 2, 50)]
    assert ways[0] > ways[1], "a quarter of a quantum is too little to be as early"
    # Which of two objects comes first can make one of them a reading earlier; a step of the robot is 15 mm.
    assert all(smaller >= larger - 0.03 for smaller, larger in pairwise(ways)), ways
    cut = [sweep[most]["cut_short"] for most in (0.25, 1, 2, 50)]
    assert cut == sorted(cut, reverse=True)
    assert cut[0] > 0.9
    assert cut[-1] == 0.0


@pytest.mark.compiled
def test_and_they_are_never_worse_in_the_end(sweep: dict[float, BudgetRow]) -> None:
    best = sweep[50]
    assert best["mean_error"] is not None
    for most, row in sweep.items():
        assert (row["found"], row["false"]) == (40, 0), most
        assert row["mean_error"] is not None
        assert row["mean_error"] <= best["mean_error"] + 0.0003, (most, row["mean_error"])


@pytest.mark.compiled
def test_one_command_prints_the_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "budgets.json"
    assert run_command(["experiment", "budget", "--budget-ms", "0.3", "5", "--json", str(path)]) == DONE
    got: dict[str, Any] = json.loads(path.read_bytes())
    assert [row["budget"] for row in got["budgets"]] == [0.3, 5.0]
    assert got["unit"] == "ms"
    assert all(row["found"] >= 38 and row["false"] == 0 for row in got["budgets"])
    assert "40 drums" in capsys.readouterr().out


@pytest.mark.parametrize(
    "words", [["--budget-ms", "-1"], ["--seeds", "0"], ["--scene", "clean"], ["--world", "hallway"]]
)
def test_a_sweep_that_makes_no_sense_is_refused(words: list[str]) -> None:
    assert run_command(["experiment", "budget", *words]) == WRONG_CALL


@pytest.mark.realtime
@pytest.mark.usefixtures("warm_kernels")
def test_no_cycle_takes_more_than_its_budget_and_a_quantum() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "bench.budget", str(CYCLES)],
        cwd=ROOT, text=True, capture_output=True, timeout=300, check=False,
    )  # fmt: skip
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert [both["in_every_drive"]["cycles_beyond_a_quantum"] for both in found] == [0, 0], done.stdout
    ample, tight = (both["drives"][0] for both in found)
    assert ample["cycles"] == tight["cycles"] == CYCLES
    assert "budget" not in ample["causes"], ample
    assert tight["causes"]["budget"] > 50, tight
    for figures in (ample, tight):
        # The machine's own hiccups are in a thread's CPU time too; the hardest figures are the soak's.
        assert figures["quantum_us"]["p99"] <= 500.0, figures
        assert figures["perception_us"]["p99.9"] <= figures["budget_us"] + 500.0, figures
