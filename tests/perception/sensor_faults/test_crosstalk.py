"""Crosstalk: readings that are short with one set of partners and not with others."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.records import Records, records, zeros
from perception.sensor_faults.crosstalk import SHORT_READINGS_MAX, count_short_readings, find_set, is_doubtful
from perception.sensor_faults.memory import RingMemory, SensorMemory


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


def test_sets_are_known_again_and_the_oldest_is_overwritten() -> None:
    memory = records(SensorMemory, zeros(SensorMemory, 4))
    whole, sets = records(RingMemory, zeros(RingMemory, 1)), np.zeros((2, 4), np.uint8)
    a, b, c = (
        np.array([2.0 if bit else math.nan for bit in bits]) for bits in ((1, 0, 1, 0), (0, 1, 0, 1), (1, 1, 1, 1))
    )
    assert [find_set(r, sets, memory, whole) for r in (a, b, a, b)] == [0, 1, 0, 1]
    memory[2].short_readings[0], memory[2].is_crossed[0] = 5.0, 1
    regularity = whole[0].regularity
    assert find_set(c, sets, memory, whole) == 0
    assert whole[0].regularity < regularity
    assert (memory[2].short_readings[0], memory[2].is_crossed[0]) == (0.0, 0)
    assert find_set(a, sets, memory, whole) == 1
    assert whole[0].sets_seen == 4
