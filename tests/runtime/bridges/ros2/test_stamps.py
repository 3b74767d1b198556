"""ROS stamps follow the robot's clock however states are delayed, and a jump is one line."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.bridges.ros2.stamps import StampClock
from tests.examples import examples


def test_stamps_do_not_shake_with_the_network() -> None:
    rng, clock = random.Random(3), StampClock()
    for k in range(400):
        robot_s = 0.05 * k
        arrives_s = robot_s + 0.002 + rng.expovariate(200.0)
        assert clock.update(robot_s, 1000.0 + arrives_s, arrives_s, is_steady=True) is None
        if k > 100:
            late_s = 1e-9 * clock.nanoseconds(robot_s) - (1000.0 + robot_s)
            assert 0.002 <= late_s < 0.0045


def test_a_clock_that_runs_fast_is_followed() -> None:
    clock = StampClock()
    for k in range(20_000):
        robot_s = 0.05 * k
        assert clock.update(robot_s, 1.0002 * robot_s, robot_s, is_steady=True) is None
    assert 1e-9 * clock.nanoseconds(1000.0) == pytest.approx(1000.2, abs=0.01)


@pytest.mark.parametrize("jump_s", [30.0, -30.0])
def test_a_jump_is_reported_once_and_followed(jump_s: float) -> None:
    clock = StampClock()
    clock.update(1.0, 101.0, 1.0, is_steady=True)
    note = clock.update(1.05, 101.05 + jump_s, 1.05, is_steady=True)
    assert note is not None
    assert note.startswith(f"clock jump: ROS time and the robot's clock differ by {jump_s:+.2f} s")
    assert clock.update(1.1, 101.1 + jump_s, 1.1, is_steady=True) is None
    assert clock.nanoseconds(1.1) == round(1e9 * (101.1 + jump_s))


def test_a_pause_is_no_jump() -> None:
    clock = StampClock()
    clock.update(1.0, 101.0, 1.0, is_steady=True)
    assert clock.update(1.0, 111.0, 11.0, is_steady=False) is None
    assert clock.update(1.05, 111.05, 11.05, is_steady=True) is None


@examples(0.5)
@given(st.lists(st.tuples(st.integers(0, 200), st.floats(0.1, 4.0)), max_size=4))
def test_a_stall_is_no_jump_however_long_its_states_queue(stalls: list[tuple[int, float]]) -> None:
    clock, free_s = StampClock(), 0.0
    for k in range(220):
        robot_s = 0.05 * k
        free_s = max([free_s, robot_s, *(robot_s + length_s for begin, length_s in stalls if begin == k)])
        assert clock.update(robot_s, 1000.0 + free_s, free_s, is_steady=True) is None
        late_s = 1e-9 * clock.nanoseconds(robot_s) - (1000.0 + robot_s)
        if not any(begin == 0 for begin, _ in stalls):
            assert 0.0 <= late_s < 0.01
        free_s += 1e-4


def test_a_silent_robot_is_no_jump() -> None:
    """States go on while no odometry comes."""
    clock = StampClock()
    clock.update(1.0, 101.0, 1.0, is_steady=True)
    for k in range(400):
        assert clock.update(1.05, 101.05 + 0.05 * k, 1.05 + 0.05 * k, is_steady=True) is None
    assert clock.update(21.05, 121.05, 21.05, is_steady=True) is None
    assert clock.nanoseconds(21.05) == round(1e9 * 121.05)


def test_a_robot_that_restarts_is_a_jump() -> None:
    clock = StampClock()
    clock.update(30.0, 130.0, 30.0, is_steady=True)
    note = clock.update(0.05, 131.0, 31.0, is_steady=True)
    assert note is not None
    assert clock.nanoseconds(0.05) == round(1e9 * 131.0)


def test_a_robot_clock_that_stood_still_is_followed_after_some_seconds() -> None:
    clock, notes = StampClock(), []
    for k in range(400):
        robot_s, host_s = 0.05 * k, 0.05 * k + (2.0 if k > 100 else 0.0)
        notes.append(clock.update(robot_s, 100.0 + host_s, host_s, is_steady=True))
    assert sum(note is not None for note in notes) == 1
    assert clock.nanoseconds(20.0) == pytest.approx(122e9, abs=1e7)
