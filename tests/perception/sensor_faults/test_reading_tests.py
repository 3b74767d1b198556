"""The tests of single readings: sets, runs of equal readings, and the evidence for stuck and silent sensors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.kernel import Floats
from perception.records import Records, records, zeros
from perception.sensor_faults.memory import SETS_MAX, TOO_NEAR_READINGS, RingMemory, RingSetup, SensorMemory
from perception.sensor_faults.reading_tests import (
    EQUAL_READINGS_MIN,
    FAULTS_CHANGED,
    LESS_POSSIBLE,
    LESS_TRUSTED,
    MISSED_FIRINGS_MAX,
    NEIGHBOUR_CHANGES_MIN,
    PASSED_CHANGES_MIN,
    PASSED_READINGS_MIN,
    RECOVERY_READINGS,
    begin_run,
    check_firing,
    is_stuck,
    neighbour_counts,
    others_changed,
    update_run_faults,
)
from perception.sensor_faults.report import FAILING, STUCK, TOO_NEAR

COUNT = 4
NEIGHBOURS = np.array([[1, 3], [2, 0], [3, 1], [0, 2]])
ALONE = np.full((COUNT, 2), -1)
MOUNTS = np.array([[0.0, 0.0, 0.5 * math.pi * k] for k in range(COUNT)])
HALF = math.radians(12.0)
EACH = np.ones(COUNT, np.bool_)


def sensors() -> Records[SensorMemory]:
    return records(SensorMemory, zeros(SensorMemory, COUNT))


def ring() -> Records[RingMemory]:
    return records(RingMemory, zeros(RingMemory, 1))


def setup(expected: NDArray[np.bool_]) -> RingSetup:
    return RingSetup(
        MOUNTS,
        np.zeros(COUNT),
        NEIGHBOURS,
        expected,
        HALF,
        tolerance=0.01,
        least=0.1,
        near=3.0,
        last_step=(6.66, 6.67),
    )


def run_of(memory: Records[SensorMemory], length: int, changes: int, leaps: int) -> None:
    """Sensor 0 repeats a reading while both neighbours change theirs."""
    begin_run(0, 2.0, 0.0, 0.0, 0.0, NEIGHBOURS, memory)
    memory[0].run_length = length
    for k in (1, 3):
        memory[k].counts.changes += changes
        memory[k].counts.leaps += leaps
    for k in range(1, COUNT):
        memory[k].readings, memory[k].last_m, memory[k].run_firing = 1, 1.0, 1


def test_neighbours_are_counted_from_the_beginning_of_the_run() -> None:
    memory = sensors()
    memory[1].counts.changes = memory[3].counts.changes = 100
    run_of(memory, 5, changes=3, leaps=2)
    memory[3].counts.leaps += 5
    assert neighbour_counts(0, NEIGHBOURS, memory, False) == (3.0, 2.0)  # noqa: FBT003 - kernels take no keywords
    assert neighbour_counts(0, ALONE, memory, False) == (0.0, 0.0)  # noqa: FBT003
    memory[1].steady_m = math.inf
    assert neighbour_counts(0, NEIGHBOURS, memory, True) == (3.0, 7.0), "the deaf one is left out"  # noqa: FBT003
    memory[3].steady_m = math.inf
    assert neighbour_counts(0, NEIGHBOURS, memory, True) == (0.0, 0.0)  # noqa: FBT003


def test_most_others_must_have_changed() -> None:
    memory = sensors()
    run_of(memory, 5, 0, 0)
    assert others_changed(0, memory)
    memory[1].run_firing = memory[2].run_firing = 0
    assert not others_changed(0, memory)
    memory[1].faults = STUCK
    memory[2].last_m = math.inf
    assert not others_changed(0, memory), "one other is too few"


@pytest.mark.parametrize(
    ("x", "y", "length", "changes", "leaps", "stuck"),
    [
        (1.1, 0.0, EQUAL_READINGS_MIN, NEIGHBOUR_CHANGES_MIN, 0, True),  # approached
        (0.9, 0.0, EQUAL_READINGS_MIN, NEIGHBOUR_CHANGES_MIN, 0, False),  # not far enough
        (1.1, 0.0, EQUAL_READINGS_MIN - 1, NEIGHBOUR_CHANGES_MIN, 0, False),
        (1.1, 0.0, EQUAL_READINGS_MIN, NEIGHBOUR_CHANGES_MIN - 1, 0, False),
        (0.0, 2.1, PASSED_READINGS_MIN, 4, 4, True),  # passed by, and the neighbours' readings leapt
        (0.0, 2.1, PASSED_READINGS_MIN, PASSED_CHANGES_MIN - 1, 3, False),  # along a wall
        (0.0, 2.1, PASSED_READINGS_MIN, PASSED_CHANGES_MIN, 0, True),
        (0.0, 1.9, PASSED_READINGS_MIN, PASSED_CHANGES_MIN, PASSED_CHANGES_MIN, False),
    ],
)
def test_stuck_needs_a_way_equal_readings_and_neighbours_that_change(
    x: float, y: float, length: int, changes: int, leaps: int, stuck: bool
) -> None:
    memory = sensors()
    run_of(memory, length, changes, leaps)
    assert is_stuck(0, x, y, 0.0, HALF, NEIGHBOURS, memory) == stuck
    memory[1].run_firing = memory[2].run_firing = 0
    assert not is_stuck(0, x, y, 0.0, HALF, NEIGHBOURS, memory), "the whole ring reads the same: at rest"


def test_a_stuck_sensor_recovers_after_several_other_readings() -> None:
    memory = sensors()
    run_of(memory, PASSED_READINGS_MIN, 20, 20)
    update_run_faults(0, 2.0, 3.0, 0.0, 0.0, setup(EACH), memory, ring())
    assert memory[0].faults == STUCK
    for k in range(RECOVERY_READINGS):
        assert memory[0].faults == STUCK
        update_run_faults(0, 3.0 + k, 3.0, 0.0, 0.0, setup(EACH), memory, ring())
    assert memory[0].faults == 0


class Checker:
    """Repeats `check_firing` on one ring."""

    def __init__(self) -> None:
        self.sensors, self.ring, self.sets = sensors(), ring(), np.zeros((SETS_MAX, COUNT), np.uint8)
        self.trusted, self.possible = np.zeros(COUNT), np.zeros(COUNT)
        self.expected = EACH.copy()

    def __call__(self, ranges: Floats, x: float = 0.0, yaw: float = 0.0) -> int:
        return check_firing(
            ranges,
            (x, 0.0, yaw),
            setup(self.expected),
            self.sensors,
            self.ring,
            self.sets,
            self.trusted,
            self.possible,
        )


def test_a_sensor_that_never_answers_is_failing_until_it_does() -> None:
    check, ranges = Checker(), np.array([math.nan, 2.0, 2.0, 2.0])
    results = [check(ranges) for _ in range(MISSED_FIRINGS_MAX)]
    assert results == [0] * (MISSED_FIRINGS_MAX - 1) + [FAULTS_CHANGED]
    assert check.sensors[0].faults == FAILING
    ranges[0] = 1.0
    assert check(ranges) & FAULTS_CHANGED
    assert check.sensors[0].faults == 0


def test_a_sensor_that_should_not_fire_is_not_failing() -> None:
    check, ranges = Checker(), np.array([math.nan, 2.0, 2.0, 2.0])
    check.expected[0] = False
    assert {check(ranges) for _ in range(2 * MISSED_FIRINGS_MAX)} == {0}


def test_a_stuck_sensor_is_masked_for_map_and_obstacles() -> None:
    check, ranges = Checker(), np.array([2.0, 2.0, 2.0, 2.0])
    for k in range(60):
        ranges[1:] = 1.0 + 0.5 * (k % 4)
        result = check(ranges, x=0.05 * k)
    assert check.sensors[0].faults == STUCK
    assert result == LESS_TRUSTED | LESS_POSSIBLE
    assert np.isnan([check.trusted[0], check.possible[0]]).all()
    np.testing.assert_array_equal(check.trusted[1:], ranges[1:])


def test_a_turn_of_the_ring_and_a_leap_of_the_pose_begin_a_new_run() -> None:
    check, ranges = Checker(), np.full(COUNT, 2.0)
    for _ in range(10):
        check(ranges)
    assert check.sensors[0].run_length == 10
    check(ranges, yaw=0.6 * HALF)
    assert check.sensors[0].run_length == 1
    check(ranges, yaw=0.6 * HALF)
    check(ranges, x=5.0, yaw=0.6 * HALF)
    assert check.sensors[0].run_length == 1


def test_a_firing_without_readings_or_pose_is_ignored() -> None:
    check = Checker()
    assert check(np.full(COUNT, math.nan)) == 0
    assert check(np.full(COUNT, 2.0), x=math.inf) == 0
    assert check.ring[0].firings == 0
    np.testing.assert_array_equal(check.trusted, np.full(COUNT, 2.0))


def test_a_sensor_that_reads_what_it_cannot_is_masked_until_it_behaves() -> None:
    check = Checker()
    near, far = np.array([0.09, 2.0, 2.0, 2.0]), np.array([0.11, 2.0, 2.0, 2.0])
    assert check(near) & LESS_TRUSTED
    assert math.isnan(check.trusted[0])
    assert check.possible[0] == 0.09, "the robot keeps clear of what may be there"
    for _ in range(TOO_NEAR_READINGS - 1):
        check(near)
    assert check.sensors[0].faults == TOO_NEAR
    assert math.isnan(check.possible[0])
    for _ in range(TOO_NEAR_READINGS):
        check(far)
    assert check.sensors[0].faults == 0
    assert check.possible[0] == 0.11
