"""Firings of lines: each between two samples, none twice, none of a sensor that is not there, and no flood."""

from __future__ import annotations

import math

import pytest

from drivers.firing_pattern import firing_pattern
from drivers.lines.pose_stamping import LineStamper
from drivers.lines.wire import Ranges
from drivers.messages import Flags, Odometry, Pose, Twist
from tests.drivers.lines.json_robot import ROBOT


def sample(robot_s: float) -> Odometry:
    return Odometry(robot_s, Pose(0.1 * robot_s, 0.0, 0.0), 0.0, Twist(0.1, 0.0), Flags.NONE, 0)


def stamper() -> LineStamper:
    made = LineStamper(ROBOT, 0.1)
    made.set_pattern(firing_pattern(ROBOT.ring))
    assert made.newest_s == -math.inf
    made.moved(sample(1.0), 1.0)
    assert made.newest_s == 1.0
    return made


def test_a_firing_gets_the_pose_between_the_samples_around_it() -> None:
    made = stamper()
    made.fired(1.05, Ranges({1: 2.0}))
    _, (firing,) = made.moved(sample(1.1), 1.1)
    assert firing.pose.x == pytest.approx(0.105)
    assert firing.ranges_m[1] == 2.0
    assert math.isnan(firing.ranges_m[0])


def test_one_that_comes_again_or_before_the_samples_is_counted_as_late() -> None:
    made = stamper()
    for robot_s in (1.05, 1.05, 0.3):
        made.fired(robot_s, Ranges({0: 1.0}))
    _, firings = made.moved(sample(1.1), 1.1)
    assert len(firings) == 1
    assert made.late_echoes.count == 2


def test_a_flood_of_firings_is_limited_and_said() -> None:
    made = stamper()
    passed = 0
    for k in range(1, 1000):
        made.fired(1.0 + 1e-4 * k, Ranges({0: 1.0}))
        passed += len(made.moved(sample(1.0 + 1e-4 * k), 1.0)[1])
    assert passed < 100
    assert made.excess_echoes == 999 - passed
    assert any("many more firings" in note for note in made.notes())


def test_no_firing_waits_across_lines_or_restarts() -> None:
    for forget in (LineStamper.break_off, LineStamper.restart):
        made = stamper()
        made.fired(1.05, Ranges({0: 1.0}))
        forget(made)
        assert made.moved(sample(1.1), 1.1)[1] == []


def test_a_sensor_that_is_not_there_is_noise() -> None:
    with pytest.raises(ValueError, match="no such sensor"):
        stamper().fired(1.05, Ranges({77: 1.0}))
