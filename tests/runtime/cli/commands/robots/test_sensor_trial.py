"""What `ring-test` says of a sensor by its ranges, and whether these show that it hears."""

from __future__ import annotations

import math

import pytest

from config.load import load_robot
from config.robot import FiringConfig, RingConfig
from runtime.cli.commands.robots.sensor_trial import Finding, judge_sensor, not_shown, sensor_lines

INF = math.inf
RING = RingConfig(
    count=12,
    radius_m=0.09,
    beam_half_angle_deg=15.0,
    resolution_m=0.003,
    range_min_m=0.02,
    range_max_m=4.0,
    firing=FiringConfig(preset="quadrants"),
)


@pytest.mark.parametrize(
    ("ranges", "is_good", "is_shown", "said"),
    [
        ([], False, True, "NO ANSWER"),
        ([1.0] * 15, False, True, "15 times of 20"),
        ([INF] * 20, True, False, "hears nothing within 4 m"),
        ([4.4, 4.5] * 10, True, False, "hears nothing within 4 m"),
        ([1.0, 1.003] * 10, True, True, "1.002 m, 20 echoes of 20, within 3 mm"),
        ([1.0] * 19 + [3.0], True, True, "within 0 mm"),
        ([1.0] * 20, False, True, "STUCK at 1.0000 m"),
        ([0.1] * 20, True, False, "always the same"),
        ([0.0017] * 20, False, True, "TOO SHORT, 0.0017 m, in 20 of 20 firings"),
        ([0.0017] * 3 + [1.0, 1.003] * 8 + [1.0], True, True, "1.000 m"),
        ([0.0] * 20, False, True, "ZERO in 20 of 20"),
        ([0.0] * 10 + [1.0, 1.003] * 5, False, True, "ZERO in 10 of 20"),
        ([4.0] * 20, False, True, "AT ITS MAXIMUM, 4.000 m, in 20 of 20"),
        ([6.5] * 8 + [1.0, 1.003] * 6, False, True, "AT ITS MAXIMUM, 6.500 m, in 8 of 20"),
        ([4.0] * 8 + [3.98, 3.99, 4.01] * 4, True, True, "16 echoes of 20"),
        ([1.0, 1.5] * 8 + [INF] * 4, True, True, "16 echoes of 20, unsteady by 0.50 m"),
    ],
)
def test_what_is_found_out_about_a_sensor(ranges: list[float], is_good: bool, is_shown: bool, said: str) -> None:
    """The echoes of a wall at the greatest range are spread about it, and a maximum is one value."""
    finding = judge_sensor(ranges, 20, RING, unsteadiness=0.01)
    assert (finding.is_good, finding.is_shown) == (is_good, is_shown)
    assert said in finding.text


def test_the_sensor_of_a_servo_is_shown_to_hear_by_one_bearing_and_alike_bearings_are_one_line() -> None:
    ring = load_robot("servo1").ring
    nothing, echo = Finding(is_good=True, text="", is_shown=False), Finding(is_good=True, text="")
    assert not_shown(ring, [nothing] * 60) == [0]
    assert not_shown(ring, [nothing] * 59 + [echo]) == []
    lines = sensor_lines(ring, ["hears nothing"] * 59 + ["1.2 m"])
    assert lines == ["sensor  0 at -180 to 168 degrees: hears nothing", "sensor  0 at  174 degrees: 1.2 m"]
    assert not_shown(RING, [echo, nothing] * 6) == [1, 3, 5, 7, 9, 11]
