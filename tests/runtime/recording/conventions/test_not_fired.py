"""What stands for a sensor that did not fire is found only where sensors fire in turn."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.messages import Floats
from runtime.recording.conventions.not_fired import find_not_fired, option_of, without_not_fired

ROWS, SENSORS = 400, 8


def in_turn(value: float) -> Floats:
    """Return ranges of sensors that fire one after the other, with a value elsewhere."""
    rng = np.random.default_rng(3)
    rows = np.arange(ROWS)
    ranges = np.full((ROWS, SENSORS), value)
    ranges[rows, rows % SENSORS] = np.where(rng.random(ROWS) < 0.3, 5.0, rng.uniform(0.3, 4.0, ROWS))
    return ranges


@pytest.mark.parametrize(
    ("value", "option"), [(0.0, "0"), (-1.0, "-1"), (-np.inf, "nan"), (np.inf, "inf"), (65535.0, "65535")]
)
def test_a_value_between_the_readings_of_each_sensor_is_found(value: float, option: str) -> None:
    ranges = in_turn(value)
    found = find_not_fired(ranges, "auto", 1)
    assert found == value
    assert option_of(value) == f"--not-fired {option}"
    assert find_not_fired(ranges, option, 1) == value
    assert (~np.isnan(without_not_fired(ranges, found))).sum() == ROWS
    assert find_not_fired(ranges, "empty", 1) is None


def test_a_log_in_the_forms_own_way_has_none() -> None:
    ranges = in_turn(np.nan)
    ranges[ranges == 5.0] = np.inf
    assert find_not_fired(ranges, "auto", 1) is None
    assert without_not_fired(ranges, None) is ranges


def test_silence_of_sensors_that_all_fire_is_none() -> None:
    ranges = in_turn(0.0)
    assert find_not_fired(ranges, "auto", SENSORS) is None


def test_repeats_of_silence_are_none() -> None:
    last = in_turn(np.nan)
    for k in range(1, ROWS):
        last[k] = np.where(np.isnan(last[k]), last[k - 1], last[k])
    assert find_not_fired(np.where(last == 5.0, 0.0, last), "auto", 1) is None
