"""ROS stamps follow the robot's clock however states are delayed, and a jump is one line."""

from __future__ import annotations

import random

import pytest

from runtime.bridges.ros2.stamps import StampClock


def test_stamps_do_not_shake_with_the_network() -> None:
    rng, clock = random.Random(3), StampClock()
    for k in range(400):
        robot_s = 0.05 * k
        assert clock.update(robot_s, 1000.0 + robot_s + 0.002 + rng.expovariate(200.0), is_steady=True) is None
        if k > 100:
            late_s = 1e-9 * clock.nanoseconds(robot_s) - (1000.0 + robot_s)
            assert 0.002 <= late_s < 0.0045


def test_a_clock_that_runs_fast_is_followed() -> None:
    clock = StampClock()
    for k in range(20_000):
        robot_s = 0.05 * k
        assert clock.update(robot_s, 1.0002 * robot_s, is_steady=True) is None
    assert 1e-9 * clock.nanoseconds(1000.0) == pytest.approx(1000.2, abs=0.01)


@pytest.mark.parametrize("jump_s", [30.0, -30.0])
def test_a_jump_is_reported_once_and_followed(jump_s: float) -> None:
    clock = StampClock()
    clock.update(1.0, 101.0, is_steady=True)
    note = clock.update(1.05, 101.05 + jump_s, is_steady=True)
    assert note is not None
    assert note.startswith(f"clock jump: ROS time and the robot's clock differ by {jump_s:+.2f} s")
    assert clock.update(1.1, 101.1 + jump_s, is_steady=True) is None
    assert clock.nanoseconds(1.1) == round(1e9 * (101.1 + jump_s))


def test_a_pause_is_no_jump() -> None:
    clock = StampClock()
    clock.update(1.0, 101.0, is_steady=True)
    assert clock.update(1.0, 111.0, is_steady=False) is None
    assert clock.update(1.05, 111.05, is_steady=True) is None
