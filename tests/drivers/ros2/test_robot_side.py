"""Topics of a robot with ROS, before the driver of the ring-and-base protocol, in virtual time."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from drivers.denning.codec import Decoder
from drivers.denning.frames import Echo2
from drivers.driver import LineState
from drivers.messages import Flags, Pose, Twist
from tests.drivers.ros2.robot import WALL_M, ready

STILL = Twist(0.0, 0.0)
AHEAD = Twist(0.3, 0.0)


def test_ranges_have_the_pose_of_their_own_time() -> None:
    robot = ready()
    robot.driver.release()
    robot.wanted = AHEAD
    robot.run(2.0)
    assert len(robot.firings) >= 15
    for firing in robot.firings:
        assert firing.ranges_m[0] == pytest.approx(WALL_M - 0.2 - firing.pose.x, abs=2e-3)
        assert np.isinf(firing.ranges_m[4])
    assert robot.firings[-1].pose.x > 0.4
    identity = robot.driver.identity
    assert identity is not None
    assert (identity.name, identity.sensors, identity.deadman_s) == ("ROS 2", 8, 0.3)


def test_a_reading_that_comes_late_does_not_count_as_one_of_a_newer_firing() -> None:
    """It would be placed where the robot is by then."""
    side = ready().side
    side.take_output()
    first_s = side._last_s
    side.reading("us0", 1.0, first_s + 0.5)
    side.reading("us1", 1.0, first_s + 0.2)
    side.reading("us2", 1.0, first_s + 0.501)
    side.reading("us3", 1.0, first_s + 0.6)
    echoes = [frame for frame in Decoder("robot").feed(side.take_output()) if isinstance(frame, Echo2)]
    assert [echo.fired for echo in echoes] == [0b1, 0b10, 0b100]


def test_a_velocity_is_obeyed_only_after_a_release_and_ends_with_the_host() -> None:
    robot = ready()
    robot.driver.halt()
    robot.wanted = AHEAD
    robot.run(0.5)
    assert robot.twist == STILL
    robot.driver.release()
    robot.run(0.5)
    assert robot.twist == AHEAD
    robot.frozen = True
    robot.run(0.29)
    assert robot.twist == AHEAD
    robot.run(0.1)
    assert robot.twist == STILL


def test_a_halt_is_repeated_to_a_base_that_goes_on() -> None:
    robot = ready()
    robot.driver.release()
    robot.wanted = AHEAD
    robot.run(0.5)
    robot.driver.halt()
    robot.run(0.1)
    assert robot.twist == STILL
    robot.twist = AHEAD  # the message was lost, or another program drives
    robot.run(0.1)
    assert robot.twist == STILL
    assert robot.odometry[-1].flags & Flags.LATCHED


@pytest.mark.parametrize("jump_s", [-100.0, 1000.0])
def test_a_clock_that_jumped_is_a_restart_and_one_line(jump_s: float) -> None:
    robot = ready()
    robot.offset_s += jump_s
    robot.run(1.5)
    assert robot.driver.state is LineState.READY
    assert robot.restarts == 1
    (note,) = robot.notes
    assert note.startswith("clock jump: the stamps of the odometry went from")
    robot.firings.clear()
    robot.run(1.0)
    assert len(robot.firings) >= 8


def test_silence_is_noticed_and_over_when_it_is() -> None:
    robot = ready()
    robot.side.odometry = lambda *_: None  # type: ignore[method-assign]
    robot.run(0.6)
    silent = robot.driver.state
    del robot.side.odometry
    robot.run(1.5)
    assert (silent, robot.driver.state) == (LineState.DOWN, LineState.READY)


def test_an_unknown_frame_is_one_line() -> None:
    robot = ready()
    for _ in range(3):
        robot.side.reading("camera", 1.0, robot.offset_s + robot.now_s)
        robot.side.odometry("map", robot.offset_s + robot.now_s, Pose(0.0, 0.0, 0.0), STILL, robot.now_s)
    robot.run(0.1)
    assert [note[:30] for note in robot.notes] == [
        "bad frame: a range is in 'came", "bad frame: the odometry moves "
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("range_m", "passed_on"),
    [
        (math.inf, math.inf),
        (4.01, math.inf),
        (-math.inf, math.nan),
        (math.nan, math.nan),
        (0.02, math.nan),
        (0.0, math.nan),
        (-1.0, math.nan),
        (4.0, math.inf),
        (3.996, math.inf),  # beyond the window, which is 13.1 ft
        (3.99, 3.99),
        (0.1, 0.1),
        (2.0, 2.0),
    ],
)
def test_what_a_range_means(range_m: float, passed_on: float) -> None:
    robot = ready()
    robot.range_of = lambda sensor: range_m  # type: ignore[method-assign]  # noqa: ARG005
    robot.run(0.5)
    np.testing.assert_allclose(robot.firings[-1].ranges_m[3], passed_on, atol=1e-6)
    assert len(robot.notes) == (range_m < 0.1), "one line for all sensors and readings"


def test_headings_are_unwrapped() -> None:
    robot = ready()
    robot.driver.release()
    robot.wanted = Twist(0.0, 1.0)
    take = robot.side.odometry

    def wrapped(frame: str, stamp_s: float, pose: Pose, twist: Twist, host_s: float) -> None:
        take(frame, stamp_s, replace(pose, theta=math.remainder(pose.theta, 2.0 * math.pi)), twist, host_s)

    robot.side.odometry = wrapped  # type: ignore[method-assign]
    robot.run(8.0)
    assert robot.odometry[-1].pose.theta == pytest.approx(robot.pose.theta, abs=0.1)
    assert robot.pose.theta > 7.0


def test_readings_of_different_times_are_different_firings() -> None:
    robot = ready()
    robot.firings.clear()
    stamp_s = robot.offset_s + robot.now_s
    robot.side.reading("us0", 1.0, stamp_s + 0.001)
    robot.side.reading("us1", 1.0, stamp_s + 0.004)
    robot.side.reading("us2", 1.0, stamp_s + 0.02)
    robot.run(0.2)
    fired = [tuple(np.flatnonzero(~np.isnan(firing.ranges_m)).tolist()) for firing in robot.firings]
    assert fired[:2] == [(0, 1), (2,)]


def test_any_bytes_of_the_host_are_survived() -> None:
    robot, rng = ready(), np.random.default_rng(2)
    for _ in range(50):
        robot.side.receive(rng.bytes(60), robot.now_s)
    robot.run(1.0)
    assert robot.driver.state is LineState.READY
