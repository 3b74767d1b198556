"""The robot's 32-bit counter as a time that only grows: wraps, long silences, jumps."""

from __future__ import annotations

import pytest

from drivers.denning.frames import Echo
from drivers.driver import LineState
from drivers.robot_clock import Jump, RobotClock
from tests.drivers.driver_harness import PERIOD_US, DriverHarness

WRAP = 2**32


def test_readings_are_unwrapped_by_the_runs_time() -> None:
    clock = RobotClock()
    assert clock.near_last(5) is None
    assert clock.read(WRAP - 10, 0.0) == WRAP - 10
    assert clock.read(10, 0.00002) == WRAP + 10
    hour_us = 3600 * 1_000_000
    assert clock.read((10 + 3 * hour_us) % WRAP, 3 * 3600.0 + 0.00002) == WRAP + 10 + 3 * hour_us
    assert clock.near_last((3 * hour_us) % WRAP) == WRAP + 3 * hour_us, "shortly before the last reading"


def test_a_jump_is_discarded_and_named() -> None:
    clock = RobotClock()
    clock.read(5_000_000, 10.0)
    assert clock.read(20_000, 10.02) is Jump.BACK
    assert clock.read(6_100_000, 10.02) is Jump.AHEAD
    assert clock.read(5_900_000, 10.02) == 5_900_000, "a delay of up to a second is no jump"


def test_a_jump_ahead_is_accepted_once_the_robot_has_confirmed_it() -> None:
    clock = RobotClock()
    clock.read(0, 0.0)
    clock.trust_next()
    assert clock.read(9_000_000, 0.02) == 9_000_000
    assert clock.read(19_000_000, 0.04) is Jump.AHEAD, "for one reading only"


def test_after_a_restart_the_counter_begins_anew() -> None:
    clock = RobotClock()
    clock.read(5_000_000, 1.0)
    clock.restart()
    assert clock.near_last(3) is None
    assert clock.read(20_000, 1.02) == 20_000


def test_the_clock_wraps_and_time_goes_on(harness: DriverHarness) -> None:
    start = 2**32 - 25_000
    harness.odom(start)
    harness.pass_time(0.02)
    harness.odom(start + PERIOD_US, x_0p1mm=100)
    harness.pass_time(0.02)
    harness.odom(start + 2 * PERIOD_US, x_0p1mm=200)
    harness.send(Echo(0, start + 10_000, 0, 1, (10,)), Echo(0, (start + 30_000) % 2**32, 1, 2, (10,)))
    heard = harness.robot.take_received()
    assert harness.state() is LineState.READY
    assert not heard.rebooted
    assert [f.robot_s - start * 1e-6 for f in heard.firings] == pytest.approx([0.01, 0.03], abs=1e-6)
    assert [f.pose.x for f in heard.firings] == pytest.approx([0.005, 0.015])
    assert heard.odometry is not None
    assert heard.odometry.robot_s == pytest.approx(start * 1e-6 + 0.04)


def test_a_silence_longer_than_the_wrap_does_not_lose_the_time(harness: DriverHarness) -> None:
    harness.odom(0)
    harness.robot.take_received()
    harness.robot.line_closed()
    harness.now += 3 * 3600.0
    harness.open()
    harness.handshake()
    harness.odom(3 * 3600 * 1_000_000 + 50_000)
    heard = harness.robot.take_received()
    assert heard.odometry is not None
    assert heard.odometry.robot_s == pytest.approx(3 * 3600.05 - 0.1, abs=0.01)
    assert not heard.rebooted
