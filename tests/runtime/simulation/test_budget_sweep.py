"""Tests of the budget sweep: with a smaller budget objects are reported later, and are no worse in the end."""

from __future__ import annotations

import json
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from config.errors import DONE, WRONG_CALL
from config.load import load_settings
from runtime.cli.app import run_command
from runtime.simulation.budget_sweep import BudgetRow, drive, long_hall_settings
from runtime.timing.refinement_budget import QuantumBudget

SETTINGS = long_hall_settings(load_settings("irregular"))


@pytest.mark.compiled
def test_smaller_budgets_report_later_and_end_no_worse() -> None:
    """With budgets in counted quanta, one drive each."""
    sweep: dict[float, BudgetRow] = {
        most: drive(SETTINGS, most, partial(QuantumBudget, most), (0,)) for most in (0.25, 1, 50)
    }
    ways = [row["way_m"] or 0.0 for row in sweep.values()]
    assert ways[0] > ways[1], "a quarter of a quantum per cycle delays the reports"
    # The order of two objects can make one of them a reading earlier; the robot moves 15 mm per cycle.
    assert all(smaller >= larger - 0.03 for smaller, larger in pairwise(ways)), ways
    cut = [row["cut_short"] for row in sweep.values()]
    assert cut == sorted(cut, reverse=True)
    assert cut[0] > 0.9
    assert cut[-1] == 0.0
    best = sweep[50]
    assert best["mean_error"] is not None
    for most, row in sweep.items():
        assert (row["found"], row["false"]) == (40, 0), most
        assert row["mean_error"] is not None
        assert row["mean_error"] <= best["mean_error"] + 0.0003, (most, row["mean_error"])


@pytest.mark.compiled
def test_command_prints_the_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "budgets.json"
    assert run_command(["experiment", "budget", "--quanta", "1", "--json", str(path)]) == DONE
    result: dict[str, Any] = json.loads(path.read_bytes())
    assert [row["budget"] for row in result["budgets"]] == [1.0]
    assert result["unit"] == "quanta"
    assert all(row["found"] >= 38 and row["false"] == 0 for row in result["budgets"])
    assert "40 drums" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments", [["--budget-ms", "-1"], ["--seeds", "0"], ["--scene", "clean"], ["--world", "hallway"]]
)
def test_invalid_sweep_is_refused(arguments: list[str]) -> None:
    assert run_command(["experiment", "budget", *arguments]) == WRONG_CALL
