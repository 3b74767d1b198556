"""Tests of warnings about valid but unwise settings: they name the setting, the value and the reason."""

from __future__ import annotations

from config.load import load_settings
from runtime.support.config_lint import lint_settings


def test_the_shipped_runs_need_no_warning() -> None:
    for name in ("hallway", "irregular"):
        assert lint_settings(load_settings(name)) == []


def test_a_margin_that_the_ring_cannot_hear_is_named() -> None:
    warnings = lint_settings(load_settings("hallway", ["ring.range_min_m=0.18"]))
    assert len(warnings) == 1
    assert "behaviors.arbiter.clearance_m = 0.16" in warnings[0]
    assert "ring.range_min_m = 0.18" in warnings[0]


def test_a_cycle_much_slower_than_the_ring_is_named() -> None:
    warnings = lint_settings(load_settings("hallway", ["cycle.rate_hz=5"]))
    assert len(warnings) == 1
    assert "cycle.rate_hz = 5" in warnings[0]
    assert "20 firings a second" in warnings[0]


def test_a_pattern_that_limits_the_speed_is_named() -> None:
    (warning,) = lint_settings(load_settings("hallway", ["ring.firing=single"]))
    assert warning.startswith("ring.firing: the pattern looks ahead so seldom that it limits the speed to 0.10 m/s")


def test_a_sensor_on_a_servo_looks_more_often_with_fewer_bearings() -> None:
    warnings = lint_settings(load_settings("room", ["ring.firing.step_period_s=0.015"], robot="servo1"))
    assert warnings[1].startswith("ring.firing: the pattern looks ahead so seldom")
    assert warnings[1].endswith("give the servo fewer bearings, or make step_period_s shorter")


def test_a_ring_that_one_failed_reading_stops_is_named() -> None:
    slow = ["ring.firing=single", "behaviors.arbiter.base_velocity_m_s=0.05"]
    (warning,) = lint_settings(load_settings("hallway", slow))
    assert "one reading that fails" in warning
    assert lint_settings(load_settings("hallway", [*slow, "behaviors.avoid_static_obstacle.echo_age_max_s=4"])) == []


def test_sensors_behind_the_rim_hear_nearer_to_it() -> None:
    """Parking sensors hear nothing nearer than 0.25 m; 0.13 m behind the rim they hear what is 0.12 m from it."""
    assert lint_settings(load_settings("room", robot="parking12")) == []
    at_the_rim = lint_settings(load_settings("room", ["body.radius_m=0.12"], robot="parking12"))
    assert sum("set the sensors back from the rim" in text for text in at_the_rim) == 2


def test_neighbours_that_fire_together_are_named_where_the_pattern_is_ours() -> None:
    together = ["ring.firing={sets=[[0, 1, 2]]}"]
    assert any("fire together" in text for text in lint_settings(load_settings("room", together, robot="hobby3")))
    ros = [*together, "robot.driver=ros2", "link.port=ros2"]
    assert not any("fire together" in text for text in lint_settings(load_settings("room", ros, robot="hobby3")))
