"""Ranges that no sensor can measure name it after five, and sooner where several sensors give them in turn."""

from __future__ import annotations

import numpy as np
import pytest

from perception.records import records, zeros
from perception.sensor_faults.memory import TOO_NEAR_READINGS, RingMemory, SensorMemory
from perception.sensor_faults.report import TOO_NEAR
from perception.sensor_faults.too_near import count_too_near

COUNT = 4


def test_one_sensor_is_named_after_five_and_cleared_after_as_many_others() -> None:
    (c,), ring = records(SensorMemory, zeros(SensorMemory, 1)), records(RingMemory, zeros(RingMemory, 1))
    for k in range(TOO_NEAR_READINGS):
        assert c.faults == 0, k
        count_too_near(c, True, ring)  # noqa: FBT003 - kernels take no keywords
    for k in range(TOO_NEAR_READINGS):
        assert c.faults == TOO_NEAR, k
        count_too_near(c, False, ring)  # noqa: FBT003 - kernels take no keywords
    assert c.faults == 0


@pytest.mark.parametrize(("one_of", "is_named"), [(4, True), (40, False)])
def test_sensors_that_read_so_in_turn_are_named_sooner(one_of: int, is_named: bool) -> None:
    """As where zero stands for silence; strays are rarer, and what is near a sensor stays there."""
    sensors, ring = records(SensorMemory, zeros(SensorMemory, COUNT)), records(RingMemory, zeros(RingMemory, 1))
    named, rng = False, np.random.default_rng(one_of)
    for _ in range(60 if is_named else 5_000):
        for i in range(COUNT):
            count_too_near(sensors[i], bool(rng.random() < 1.0 / one_of), ring)
            named = named or bool(sensors[i].faults)
    assert named is is_named
