"""Tests of `echolocate experiment budget`: its table, its JSON, and budgets that it refuses."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from config.errors import DONE, WRONG_CALL
from config.settings import Settings
from runtime.cli.app import run_command
from runtime.simulation import budget_sweep
from runtime.simulation.budget_sweep import BudgetRow
from runtime.timing.refinement_budget import CpuTimeBudget, QuantumBudget, RefinementBudget

Driven = list[tuple[float, RefinementBudget, Sequence[int]]]


@pytest.fixture
def driven(monkeypatch: pytest.MonkeyPatch) -> Driven:
    """Put a row of fixed numbers in place of each drive, and return the calls."""
    calls: Driven = []

    def drive(
        settings: Settings, budget: float, refinement_budget: Callable[[], RefinementBudget], seeds: Sequence[int]
    ) -> BudgetRow:
        assert settings.perception.bayes.quanta_per_firing == budget_sweep.QUANTA_PER_FIRING
        calls.append((budget, refinement_budget(), seeds))
        return {
            "budget": budget, "quanta": 1.0, "cut_short": 0.25, "first_s": 3.0, "first_m": 0.9, "way_m": 20.5,
            "drums": 40 * len(seeds), "found": 39, "false": 0, "mean_error": 0.011, "max_error": 0.07,
        }  # fmt: skip

    monkeypatch.setattr(budget_sweep, "drive", drive)
    return calls


@pytest.mark.parametrize(
    ("words", "unit", "kind"),
    [(["--budget-ms", "0.3", "5"], "ms", CpuTimeBudget), (["--quanta", "0.3", "5"], "quanta", QuantumBudget)],
)
def test_command_prints_the_table(
    driven: Driven, tmp_path: Path, words: list[str], unit: str, kind: type, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "budgets.json"
    assert run_command(["experiment", "budget", *words, "--seeds", "2", "--json", str(path)]) == DONE
    assert [(most, type(budget), list(seeds)) for most, budget, seeds in driven[1:]] == [
        (0.3, kind, [0, 1]), (5.0, kind, [0, 1]),
    ]  # fmt: skip
    result = json.loads(path.read_bytes())
    assert (result["unit"], [row["budget"] for row in result["budgets"]]) == (unit, [0.3, 5.0])
    assert "40 drums" in capsys.readouterr().out


@pytest.mark.parametrize("words", [["--budget-ms", "-1"], ["--quanta", "nan"], ["--budget-ms", "inf"]])
def test_an_invalid_budget_is_refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["experiment", "budget", *words]) == WRONG_CALL
    assert words[0] in capsys.readouterr().err
