"""Tests of the budget sweep: with a smaller budget objects are reported later, and are no worse in the end."""

from __future__ import annotations

from functools import partial

import pytest

from config.load import load_settings
from config.settings import Settings
from config.units import FOOT_M
from runtime.simulation.budget_sweep import drive, long_hall_settings
from runtime.simulation.long_hall import A_SIDE, PITCH_FT, WAY_M, long_hall, long_hall_drums
from runtime.timing.refinement_budget import QuantumBudget

SETTINGS = long_hall_settings(load_settings("irregular"))
BUDGETS = (0.25, 50)
"""Quanta per cycle: far too few, and more than are ever needed."""

pytestmark = pytest.mark.compiled


@pytest.fixture
def hall(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> tuple[int, float, Settings]:
    """Return a hall's drums on each side, its way, and the settings for it; the short form has a quarter of it."""
    a_side: int = request.param
    drums = tuple(long_hall_drums(0, a_side))
    world = long_hall(0).model_copy(update={"drum": drums})
    monkeypatch.setattr("runtime.simulation.budget_sweep.long_hall", lambda _seed: world)
    way_m = WAY_M - (A_SIDE - a_side) * PITCH_FT * FOOT_M
    ahead = SETTINGS.behaviors.move_ahead.model_copy(update={"distance_m": way_m})
    behaviors = SETTINGS.behaviors.model_copy(update={"move_ahead": ahead})
    return a_side, way_m, SETTINGS.model_copy(update={"behaviors": behaviors})


@pytest.mark.parametrize("hall", [5, pytest.param(A_SIDE, marks=pytest.mark.soak)], indirect=True)
def test_smaller_budgets_report_later_and_end_no_worse(hall: tuple[int, float, Settings]) -> None:
    a_side, way_m, settings = hall
    least, most = (drive(settings, most, partial(QuantumBudget, most), (0,)) for most in BUDGETS)
    for row in (least, most):
        assert (row["drums"], row["found"], row["false"]) == (2 * a_side, 2 * a_side, 0), row["budget"]
        assert row["mean_error"] is not None
        assert most["mean_error"] is not None
        assert row["mean_error"] <= most["mean_error"] + 0.0003, row["budget"]
        assert row["first_m"] is not None
        assert row["way_m"] is not None
        assert 0.0 < row["first_m"] < row["way_m"] < way_m
    assert (least["way_m"] or 0.0) > (most["way_m"] or 0.0), "a quarter of a quantum per cycle delays the reports"
    assert least["cut_short"] > 0.9
    assert most["cut_short"] == 0.0
    assert least["quanta"] <= 0.25


def test_the_robot_stops_at_the_end_of_the_hall() -> None:
    ahead = SETTINGS.behaviors.move_ahead
    assert (ahead.distance_m, ahead.at_end) == (WAY_M, "stop")
