"""A Denning in virtual time whose clock wraps, that falls silent, turns deaf or restarts: detected and reported."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.denning.frames import (
    Drive,
    Echo,
    Frame,
    Hello,
    Pattern,
)
from drivers.driver import LineState
from drivers.messages import Pose, Twist
from tests.drivers.driver_harness import IDENT, PERIOD_US, DriverHarness, only


def test_silence_is_down_and_motion_does_not_resume_by_itself(harness: DriverHarness) -> None:
    t_us = harness.run(1.0, t_us=0)
    assert harness.state() is LineState.READY
    harness.robot.drive(Twist(0.1, 0.0))
    harness.pass_time(0.39)
    assert harness.state() is LineState.READY
    harness.robot.release()
    harness.pass_time(0.02)
    assert harness.state() is LineState.DOWN
    assert "nothing received for 0.41 s" in (harness.robot.problem or "")
    assert harness.received() == []
    harness.run(1.0, t_us=t_us + 600_000)
    assert harness.state() is LineState.READY
    assert only(harness.received(), Drive) == []


def test_two_robots_that_answer_on_one_line_are_named_until_one_is_alone() -> None:
    """They are alike but for the numbers of their boots, which no restart brings back."""
    harness = DriverHarness()
    harness.open()
    other = replace(IDENT, boot_id=0xB002)
    for _ in range(2):
        assert only(harness.received(), Hello)
        harness.send(IDENT)
        harness.send(other)
    assert harness.state() is LineState.DOWN
    assert "two robots answer on this line" in (harness.robot.problem or "")
    harness.run(2.0, t_us=0)
    assert harness.state() is LineState.READY
    assert harness.robot.problem is None


def test_a_robot_that_restarts_again_and_again_is_one() -> None:
    harness = DriverHarness()
    harness.open()
    for boot_id in range(5):
        harness.received()
        harness.send(replace(IDENT, boot_id=boot_id))
    assert harness.state() is LineState.HANDSHAKE
    assert harness.robot.problem is None


def test_a_robot_whose_boot_numbers_repeat_is_one() -> None:
    """One whose board has few random bits, or that is exchanged with another and back while the line stays open."""
    harness = DriverHarness()
    harness.open()
    harness.handshake()
    for boot_id in (0xB002, IDENT.boot_id, 0xB002):
        harness.ident = replace(IDENT, boot_id=boot_id)
        for k in range(60):
            harness.run(0.1, t_us=100_000 * k)
            assert harness.robot.problem is None
        assert harness.state() is LineState.READY
        assert harness.robot.take_received().rebooted


def drive_on(harness: DriverHarness, seconds: float, t_us: int, *, deaf: bool = False, flags: int = 0) -> int:
    """Drive at 20 Hz with a robot that names the DRIVE it took last, but for the time that it is deaf."""
    last = harness.last_drive
    for _ in range(round(seconds / 0.05)):
        harness.robot.drive(Twist(0.1, 0.0))
        taken = [frame.seq for frame in harness.answer() if isinstance(frame, Drive)]
        last = last if deaf else taken[-1] if taken else last
        harness.now += 0.05
        t_us += 50_000
        harness.odom(t_us, last_drive_seq=last, flags=flags)
        harness.send(Echo(0, t_us, 0, 1, (10,)))
        harness.robot.tick(harness.now)
    harness.last_drive = last
    return t_us


def test_a_robot_that_sends_but_acknowledges_no_drive_is_down(harness: DriverHarness) -> None:
    t_us = drive_on(harness, 1.0, 0)
    assert harness.state() is LineState.READY
    drive_on(harness, 0.3, t_us, deaf=True)
    assert harness.state() is LineState.READY
    drive_on(harness, 0.1, t_us + 300_000, deaf=True)
    assert harness.state() is LineState.DOWN
    assert "sends but has not acknowledged a DRIVE for 0.35 s" in (harness.robot.problem or "")
    assert "check the cable" in (harness.robot.problem or "")


def test_a_robot_that_never_acknowledges_drives_is_not_supervised(harness: DriverHarness) -> None:
    drive_on(harness, 30.0, 0, deaf=True)
    assert harness.state() is LineState.READY


def test_a_latched_robot_need_not_acknowledge_drives(harness: DriverHarness) -> None:
    t_us = drive_on(harness, 1.0, 0)
    drive_on(harness, 2.0, t_us, deaf=True, flags=1)
    assert harness.state() is LineState.READY


def test_a_few_lost_drives_do_not_take_the_link_down(harness: DriverHarness) -> None:
    t_us = drive_on(harness, 1.0, 0)
    for _ in range(20):
        t_us = drive_on(harness, 0.25, t_us, deaf=True)
        t_us = drive_on(harness, 0.05, t_us)
    assert harness.state() is LineState.READY


@pytest.mark.parametrize("boot_id", [IDENT.boot_id, 0xB002])
def test_a_robot_whose_ring_falls_silent_is_sent_hello(harness: DriverHarness, boot_id: int) -> None:
    """A restart just as the clock wraps shows in nothing but that: the pattern is gone, and the odometry goes on."""
    t_us = harness.run(0.45, t_us=2**32 - 500_000)
    harness.robot.take_received()
    harness.ident = replace(IDENT, boot_id=boot_id)
    heard: list[Frame] = []
    for _ in range(10):
        t_us += PERIOD_US
        harness.now += 0.02
        harness.odom(t_us)
        harness.robot.tick(harness.now)
        heard += harness.answer()
    heard += harness.answer()
    restarted = boot_id != IDENT.boot_id
    assert [type(frame) for frame in heard] == ([Hello, Pattern] if restarted else [Hello])
    assert harness.robot.take_received().rebooted == restarted
    assert harness.state() is LineState.READY
    assert harness.robot.problem is None


def test_a_silent_ring_causes_about_two_hellos_a_second(harness: DriverHarness) -> None:
    hellos, t_us = 0, 0
    for _ in range(500):
        t_us += PERIOD_US
        harness.now += 0.02
        harness.odom(t_us)
        harness.robot.tick(harness.now)
        hellos += len(only(harness.received(), Hello))
    assert harness.state() is LineState.READY, "no one need answer"
    assert 15 <= hellos <= 20


def test_missing_odometry_alone_is_down_too(harness: DriverHarness) -> None:
    for _ in range(30):
        harness.pass_time(0.02)
        harness.send(Echo(0, 5, 0, 1, (10,)))
    assert harness.state() is LineState.DOWN
    assert "no odometry" in (harness.robot.problem or "")


def test_after_one_echo_and_then_silence_the_message_says_nothing_received(harness: DriverHarness) -> None:
    t_us = harness.run(0.2, t_us=0)
    harness.pass_time(0.01)
    harness.send(Echo(0, t_us, 0, 1, (10,)))
    harness.pass_time(0.4)
    assert harness.state() is LineState.DOWN
    assert "nothing received" in (harness.robot.problem or "")


def test_a_restart_between_two_lines_is_noticed(harness: DriverHarness) -> None:
    harness.odom(5_000_000)
    harness.send(Echo(0, 5_000_000, 0, 1, (10,)))
    harness.robot.line_closed()
    assert harness.state() is LineState.CLOSED
    harness.now += 1.0
    harness.ident = replace(IDENT, boot_id=0xB002)
    harness.open()
    harness.odom(20_000)
    harness.handshake()
    heard = harness.robot.take_received()
    assert heard.rebooted
    assert heard.firings == ()
    assert heard.odometry is None
    harness.odom(40_000)
    heard = harness.robot.take_received()
    assert not heard.rebooted
    assert heard.odometry is not None
    assert heard.odometry.robot_s == pytest.approx(0.04)


@pytest.mark.parametrize("boot_id", [0xB002, IDENT.boot_id])
def test_a_restart_in_mid_run_is_noticed_by_the_clock(harness: DriverHarness, boot_id: int) -> None:
    harness.run(2.0, t_us=3_000_000)
    harness.send(Echo(0, 5_000_000, 0, 1, (10,)))
    harness.robot.drive(Twist(0.1, 0.0))
    harness.ident = replace(IDENT, boot_id=boot_id)
    harness.pass_time(0.2)
    harness.odom(20_000, x_0p1mm=5)
    assert harness.state() is LineState.HANDSHAKE
    harness.odom(40_000, x_0p1mm=6)
    assert [type(frame) for frame in harness.answer()] == [Hello]
    assert [type(frame) for frame in harness.answer()] == [Pattern]
    assert harness.state() is LineState.READY
    heard = harness.robot.take_received()
    assert heard.rebooted
    assert heard.firings == ()
    assert heard.odometry is None
    harness.odom(60_000, x_0p1mm=7)
    harness.odom(80_000, x_0p1mm=9)
    harness.send(Echo(0, 70_000, 0, 1, (10,)))
    (firing,) = harness.robot.take_received().firings
    assert (firing.robot_s, firing.pose.x) == pytest.approx((0.07, 0.0008))


def test_a_restart_that_announces_itself_is_noticed(harness: DriverHarness) -> None:
    harness.odom(5_000_000)
    harness.robot.drive(Twist(0.1, 0.0))
    harness.send(replace(IDENT, boot_id=0xB002))
    assert harness.state() is LineState.HANDSHAKE
    assert [type(frame) for frame in harness.answer()] == [Pattern]
    assert harness.robot.take_received().rebooted


def test_a_second_identity_changes_nothing(harness: DriverHarness) -> None:
    harness.odom(5_000_000)
    harness.send(IDENT)
    assert harness.state() is LineState.READY
    assert harness.received() == []
    assert not harness.robot.take_received().rebooted


@pytest.mark.parametrize(("t_us", "x"), [(9_000_000, 0), (1_020_000, 50_000)])
def test_after_a_jump_of_clock_or_pose_the_robot_is_identified_and_nothing_interpolated_across_it(
    harness: DriverHarness, t_us: int, x: int
) -> None:
    harness.odom(1_000_000)
    harness.pass_time(0.02)
    harness.odom(t_us, x_0p1mm=x)
    assert harness.state() is LineState.HANDSHAKE
    harness.handshake()
    assert not harness.robot.take_received().rebooted
    harness.odom(t_us + PERIOD_US, x_0p1mm=x)
    assert harness.state() is LineState.READY
    harness.send(Echo(0, t_us + 10_000, 0, 1, (10,)))
    heard = harness.robot.take_received()
    assert heard.firings == (), "the place of the echo is unknown"
    assert heard.odometry is not None
    assert heard.odometry.pose == Pose(0.0, 0.0, 0.0), "no base moves so far at once"
    assert harness.robot.odometry_origin == Pose(x * 1e-4, 0.0, 0.0)
    assert harness.robot.stamper.late_echoes.count == 1


@pytest.mark.promise("P25")
@pytest.mark.parametrize("deadman_ms", [0, 1, 99, 1001, 65_535])
def test_a_deadman_outside_the_robot_file_s_bounds_is_refused(deadman_ms: int) -> None:
    harness = DriverHarness()
    harness.ident = replace(IDENT, deadman_ms=deadman_ms)
    harness.open()
    harness.answer()
    harness.robot.drive(Twist(0.1, 0.0))
    assert only(harness.received(), Drive) == []
    assert harness.state() is LineState.DOWN
    problem = harness.robot.problem or ""
    assert f"stops by itself {1e-3 * deadman_ms:g} s after the last command" in problem
    assert "allows 0.1 to 1 s; correct the deadman" in problem


@pytest.mark.promise("P25")
@pytest.mark.parametrize("deadman_ms", [100, 1000])
def test_a_deadman_at_either_bound_is_accepted(deadman_ms: int) -> None:
    harness = DriverHarness()
    harness.ident = replace(IDENT, deadman_ms=deadman_ms)
    harness.open()
    harness.handshake()
