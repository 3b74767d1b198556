"""A full turn in place separates a stuck sensor from an honest one, in rooms of any shape."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from perception.records import records, zeros
from perception.sensor_faults.memory import RingMemory
from perception.sensor_faults.report import STUCK
from perception.sensor_faults.turning import IN_PLACE_M, follow_turn, repeats_through_turn
from perception.shared_numbers import SAME_ECHO_M
from tests.perception.sensor_faults.test_reading_tests import COUNT, Checker, ring, sensors

STEP_RAD = 0.1


def square_room(bearing: float) -> float:
    """Return the range of a wall of a room of 2 m by 3 m, seen from its middle."""
    return min(1.0 / max(1e-9, abs(math.cos(bearing))), 1.5 / max(1e-9, abs(math.sin(bearing))))


def round_room(_bearing: float) -> float:
    return 1.2


def spin(check: Checker, room: Callable[[float], float], turns: float, stuck: int | None = None) -> None:
    for k in range(round(turns * math.tau / STEP_RAD)):
        yaw = k * STEP_RAD
        ranges = np.array([room(yaw + 0.5 * math.pi * i) for i in range(COUNT)])
        if stuck is not None:
            ranges[stuck] = 0.2
        check(ranges, yaw=math.remainder(yaw, 2.0 * math.pi))


def test_a_sensor_that_repeats_its_reading_through_a_full_turn_is_stuck() -> None:
    check = Checker()
    spin(check, square_room, 0.9, stuck=2)
    assert check.sensors[2].faults == 0
    check = Checker()
    spin(check, square_room, 1.1, stuck=2)
    assert [one.faults for one in check.sensors] == [0, 0, STUCK, 0]
    assert math.isnan(check.possible[2])


@pytest.mark.covered
@pytest.mark.parametrize("room", [square_room, round_room])
def test_no_honest_sensor_is_stuck_however_long_the_ring_turns(room: Callable[[float], float]) -> None:
    check = Checker()
    spin(check, room, 12.0)
    assert not any(one.faults for one in check.sensors)


def test_a_ring_that_goes_round_an_object_does_not_turn_in_place() -> None:
    """The sensor that looks at it always reads the same."""
    check = Checker()
    for k in range(200):
        yaw = k * STEP_RAD
        ranges = np.array([0.4, *(2.0 + math.sin(3.0 * yaw + i) for i in range(1, COUNT))])
        check(ranges, x=0.5 * math.cos(yaw), yaw=yaw)
    assert check.sensors[0].faults & STUCK == 0


def test_the_turn_begins_anew_elsewhere_and_after_two_turns() -> None:
    memory = ring()
    for k in range(40):
        memory[0].firings += 1
        follow_turn(0.0, 0.0, k * STEP_RAD, memory)
    assert memory[0].turned == pytest.approx(3.9)
    memory[0].firings += 1
    follow_turn(1.1 * IN_PLACE_M, 0.0, 4.0, memory)
    assert (memory[0].turned, memory[0].turn_firing) == (0.0, 41)
    memory[0].turned = -2.0 * math.tau
    memory[0].firings += 1
    follow_turn(1.1 * IN_PLACE_M, 0.0, 4.1, memory)
    assert (memory[0].turned, memory[0].turn_firing) == (0.0, 42)


def test_most_others_must_read_otherwise_and_its_run_be_as_old_as_the_turn() -> None:
    def judged(*others: float, run_firing: int = 5, turned: float = math.tau) -> bool:
        memory, of_ring = sensors(), records(RingMemory, zeros(RingMemory, 1))
        of_ring[0].turned, of_ring[0].turn_firing = turned, 5
        memory[0].run_firing = run_firing
        for k, range_m in enumerate(others, 1):
            memory[k].readings, memory[k].last_m = 1, range_m
        return bool(repeats_through_turn(0, 1.0, memory, of_ring))

    far = 1.0 + 2.0 * SAME_ECHO_M
    assert judged(far, far, 1.0)
    assert judged(far, far, 1.0, turned=-math.tau)
    assert not judged(far, 1.0, 1.0)
    assert not judged(far, math.inf, math.inf), "silence says nothing"
    assert not judged(far, far, far, run_firing=6)
    assert not judged(far, far, far, turned=0.9 * math.tau)
