"""Counts become poses, reports firings; a corrupt sample, a wrapped counter and a restart."""

from __future__ import annotations

import math

import pytest

from config.load import load_robot
from drivers.messages import Firing, Flags, Odometry
from drivers.rflex.codec import NO_ECHO, AxisReport, SonarReport
from drivers.rflex.measurements import Measurements
from drivers.rflex.wire_units import pattern_of, sonar_ids
from drivers.robot_clock import Jump

B21R = load_robot("b21r")
PER_M, PER_RAD = B21R.rflex.distance_factor, B21R.rflex.angle_factor


class Robot:
    """Reports every 50 ms, from a clock that starts at 5 s."""

    def __init__(self) -> None:
        self.measurements = Measurements(B21R, sonar_ids(B21R))
        self.measurements.set_pattern(pattern_of(B21R, B21R.ring))
        self.t_us, self.run_s = 5_000_000, 0.0

    def says(self, way: int, turn: int, v: int = 0) -> Odometry | Jump | None:
        self.t_us += 50_000
        self.run_s += 0.05
        reports = (AxisReport(self.t_us, 0, way, v), AxisReport(self.t_us, 1, turn, 0))
        first, second = (self.measurements.axis(report, self.run_s, Flags.NONE) for report in reports)
        assert first is None
        return second

    def fires(self, *readings: tuple[int, int]) -> list[Firing]:
        self.measurements.sonar(SonarReport(self.t_us, readings))
        return self.measurements.firings(self.run_s)


def test_counts_become_an_arc() -> None:
    robot = Robot()
    robot.says(1000, 2000)
    for k in range(1, 41):
        sample = robot.says(1000 + round(k * 0.02 * PER_M), 2000 + round(k * 0.04 * PER_RAD))
    assert isinstance(sample, Odometry)
    assert sample.pose.theta == pytest.approx(1.6, abs=1e-4)
    assert (sample.pose.x, sample.pose.y) == pytest.approx(
        (0.5 * math.sin(1.6), 0.5 * (1.0 - math.cos(1.6))), abs=1e-4
    )
    assert sample.ring_yaw == sample.pose.theta


def test_counters_wrap() -> None:
    robot = Robot()
    robot.says(2**31 - 500, -(2**31) + 500)
    sample = robot.says(-(2**31) + 500, 2**31 - 500)
    assert isinstance(sample, Odometry)
    assert sample.pose.x == pytest.approx(1000 / PER_M, rel=1e-2)
    assert sample.pose.theta == pytest.approx(-1000 / PER_RAD)


def test_a_sample_out_of_line_needs_a_second_one() -> None:
    robot = Robot()
    robot.says(0, 0)
    assert robot.says(4 << 20, 0) is None, "a flipped bit"
    assert isinstance(robot.says(10, 0), Odometry)
    assert robot.says(10, 0, v=1 << 24) is None
    assert robot.says(4 << 20, 0) is None
    assert isinstance(robot.says((4 << 20) + 10, 0), Odometry), "it stays there: another client set it"


def test_axes_of_different_times_do_not_pair() -> None:
    robot = Robot()
    robot.says(0, 0)
    axis = robot.measurements.axis
    assert axis(AxisReport(5_100_000, 0, 0, 0), 0.1, Flags.NONE) is None
    assert axis(AxisReport(5_150_000, 1, 0, 0), 0.15, Flags.NONE) is None
    assert isinstance(axis(AxisReport(5_150_000, 0, 0, 0), 0.15, Flags.NONE), Odometry)


def test_a_restart_is_seen_by_two_times_or_by_counts_at_zero() -> None:
    robot = Robot()
    for way in range(0, 100_000, 1000):
        robot.says(way, 0)
    robot.t_us = 0
    assert robot.says(0, 0) is None
    assert robot.says(0, 0) is Jump.BACK
    sample = robot.says(0, 0)
    assert isinstance(sample, Odometry)
    assert sample.pose.x == 0.0
    for way in range(0, 100_000, 1000):
        robot.says(way, 0)
    robot.measurements.break_off()
    assert robot.says(0, 0) is Jump.BACK


def test_a_firing_lies_one_step_before_its_report() -> None:
    robot = Robot()
    robot.says(0, 0)
    robot.says(round(0.02 * PER_M), 0)
    (firing,) = robot.fires((0, 1476), (16, NO_ECHO), (32, 0), (48, 7000), (240, 1000))
    assert firing.robot_s == pytest.approx(1e-6 * robot.t_us - 0.03)
    assert firing.pose.x == pytest.approx(0.008, abs=1e-4)
    assert firing.ranges_m[0] == pytest.approx(1.0)
    assert firing.ranges_m[4] == math.inf
    assert math.isnan(firing.ranges_m[8])
    assert firing.ranges_m[12] == pytest.approx(7000 / 1476)
    assert robot.fires((0, 1476)) == [], "none twice"
    assert robot.fires((240, 1476)) == []
    assert robot.measurements.late_echoes.count == 1


def test_timestamps_that_are_no_microseconds_are_noted_once() -> None:
    robot = Robot()
    for _ in range(400):
        robot.t_us += 450_000  # ten times too fast
        robot.says(0, 0)
    (note,) = robot.measurements.notes()
    assert "timestamps run" in note
