"""The settings that the page can change: with bounds, choices, units and a description from the schema."""

from __future__ import annotations

from config.load import load_settings
from runtime.console.commands.parameters import parameters


def test_parameters_have_bounds_choices_and_units() -> None:
    found = {parameter["path"]: parameter for parameter in parameters(load_settings("hallway"))}
    gain = found["behaviors.avoid_static_obstacle.avoid_obstacle_gain"]
    assert (gain["kind"], gain["low"], gain["high"], gain["value"]) == ("float", 0.0, 100.0, 1.0)
    velocity = found["behaviors.arbiter.base_velocity_m_s"]
    assert velocity["label"] == "base velocity (m/s)"
    preset = found["ring.firing.preset"]
    assert preset["kind"] == "choice"
    assert preset["choices"] is not None
    assert "quadrants" in preset["choices"]
    assert found["behaviors.move_ahead.distance_m"]["optional"]


def test_every_parameter_is_described() -> None:
    for parameter in parameters(load_settings("hallway")):
        assert parameter["help"], parameter["path"]
        assert parameter["kind"] in {"bool", "int", "float", "text", "choice"}


def test_a_setting_that_needs_a_restart_is_no_parameter() -> None:
    assert "cycle.rate_hz" not in {parameter["path"] for parameter in parameters(load_settings("hallway"))}
