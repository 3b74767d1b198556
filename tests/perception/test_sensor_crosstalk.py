"""Crosstalk: readings that are short with one set of partners and not with others."""

from __future__ import annotations

import pytest

from perception.records import Records, records, zeros
from perception.sensor_crosstalk import SHORT_READINGS_MAX, count_short_readings, is_doubtful
from perception.sensor_memory import SensorMemory


def sensor(readings: int = 2, last_m: float = 4.0, before_last_m: float = 4.0) -> Records[SensorMemory]:
    """A sensor whose last reading was with set 0 and the one before with set 1."""
    c = records(SensorMemory, zeros(SensorMemory, 1))
    c[0].readings, c[0].last_m, c[0].before_last_m = readings, last_m, before_last_m
    c[0].last_set, c[0].before_last_set = 0, 1
    return c


def test_a_reading_is_short_if_it_is_below_both_of_its_neighbours_in_time() -> None:
    c = sensor(last_m=1.0)
    count_short_readings(c[0], 4.0, 1)
    assert c[0].short_readings[0] == 1.0
    c = sensor(last_m=1.0, before_last_m=1.1)
    count_short_readings(c[0], 4.0, 1)
    assert c[0].short_readings[0] == 0.0, "the base may have come near"
    c = sensor(last_m=3.9)
    count_short_readings(c[0], 4.0, 1)
    assert c[0].short_readings[0] == 0.0, "not by more than noise"


@pytest.mark.parametrize(("readings", "fired_set"), [(1, 1), (2, 0)])
def test_only_readings_with_other_sets_are_compared(readings: int, fired_set: int) -> None:
    c = sensor(readings, last_m=1.0)
    count_short_readings(c[0], 4.0, fired_set)
    assert c[0].short_readings[0] == 0.0


def test_a_set_is_masked_after_several_short_readings_and_freed_after_others() -> None:
    c = sensor(last_m=1.0)
    for k in range(int(3 * SHORT_READINGS_MAX)):
        count_short_readings(c[0], 4.0, 1)
        assert c[0].is_crossed[0] == (k + 1 >= SHORT_READINGS_MAX)
    c[0].last_m = 4.0
    for _ in range(int(SHORT_READINGS_MAX) - 1):
        count_short_readings(c[0], 4.0, 1)
    assert c[0].is_crossed[0] == 1
    count_short_readings(c[0], 4.0, 1)
    assert c[0].is_crossed[0] == 0, "each other reading subtracts two of at most twice the limit"


def test_a_reading_is_doubtful_if_it_is_shorter_than_motion_explains() -> None:
    c = sensor()
    assert is_doubtful(c[0], 1.0, 0.0, 0.0, 1)
    assert not is_doubtful(c[0], 3.87, 0.0, 0.0, 1), "within noise"
    assert is_doubtful(c[0], 3.85, 0.0, 0.0, 1)
    assert not is_doubtful(c[0], 1.0, 3.0, 0.0, 1), "the base has come nearer"
    assert not is_doubtful(c[0], 1.0, 0.0, 0.0, 0), "with the same partners"
    assert not is_doubtful(sensor(readings=0)[0], 1.0, 0.0, 0.0, 1)
