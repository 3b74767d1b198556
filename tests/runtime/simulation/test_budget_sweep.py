"""Tests of the budget sweep: with a smaller budget objects are reported later, and are no worse in the end."""

from __future__ import annotations

from functools import partial

import pytest

from config.load import load_settings
from runtime.simulation.budget_sweep import BudgetRow, drive, long_hall_settings
from runtime.simulation.long_hall import WAY_M
from runtime.timing.refinement_budget import QuantumBudget

SETTINGS = long_hall_settings(load_settings("irregular"))
BUDGETS = (0.25, 50)
"""Quanta per cycle: far too few, and more than are ever needed."""

pytestmark = pytest.mark.compiled


@pytest.fixture(scope="module")
def sweep() -> dict[float, BudgetRow]:
    """Return the results of a drive under each of several budgets in counted quanta."""
    return {most: drive(SETTINGS, most, partial(QuantumBudget, most), (0,)) for most in BUDGETS}


def test_smaller_budgets_report_later_and_end_no_worse(sweep: dict[float, BudgetRow]) -> None:
    least, most = (sweep[budget] for budget in BUDGETS)
    for row in (least, most):
        assert (row["drums"], row["found"], row["false"]) == (40, 40, 0), row["budget"]
        assert row["mean_error"] is not None
        assert most["mean_error"] is not None
        assert row["mean_error"] <= most["mean_error"] + 0.0003, row["budget"]
        assert row["first_m"] is not None
        assert row["way_m"] is not None
        assert 0.0 < row["first_m"] < row["way_m"] < WAY_M
    assert (least["way_m"] or 0.0) > (most["way_m"] or 0.0), "a quarter of a quantum per cycle delays the reports"
    assert least["cut_short"] > 0.9
    assert most["cut_short"] == 0.0
    assert least["quanta"] <= 0.25


def test_the_robot_stops_at_the_end_of_the_hall() -> None:
    ahead = SETTINGS.behaviors.move_ahead
    assert (ahead.distance_m, ahead.at_end) == (WAY_M, "stop")
