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
from tests.drivers.scripted import IDENT, PERIOD_US, Bench, only


def test_the_clock_wraps_and_time_goes_on(bench: Bench) -> None:
    start = 2**32 - 25_000
    bench.odom(start)
    bench.pass_time(0.02)
    bench.odom(start + PERIOD_US, x_0p1mm=100)
    bench.pass_time(0.02)
    bench.odom(start + 2 * PERIOD_US, x_0p1mm=200)
    bench.say(Echo(0, start + 10_000, 0, 1, (10,)), Echo(0, (start + 30_000) % 2**32, 1, 2, (10,)))
    heard = bench.robot.take_received()
    assert bench.state() is LineState.READY
    assert not heard.rebooted
    assert [f.robot_s - start * 1e-6 for f in heard.firings] == pytest.approx([0.01, 0.03], abs=1e-6)
    assert [f.pose.x for f in heard.firings] == pytest.approx([0.005, 0.015])
    assert heard.odometry is not None
    assert heard.odometry.robot_s == pytest.approx(start * 1e-6 + 0.04)


def test_a_silence_longer_than_the_wrap_does_not_lose_the_time(bench: Bench) -> None:
    bench.odom(0)
    bench.robot.take_received()
    bench.robot.line_closed()
    bench.now += 3 * 3600.0
    bench.open()
    bench.greet()
    bench.odom(3 * 3600 * 1_000_000 + 50_000)
    heard = bench.robot.take_received()
    assert heard.odometry is not None
    assert heard.odometry.robot_s == pytest.approx(3 * 3600.05 - 0.1, abs=0.01)
    assert not heard.rebooted


def test_silence_is_down_and_motion_does_not_resume_by_itself(bench: Bench) -> None:
    t_us = bench.run(1.0, t_us=0)
    assert bench.state() is LineState.READY
    bench.robot.drive(Twist(0.1, 0.0))
    bench.pass_time(0.39)
    assert bench.state() is LineState.READY
    bench.robot.release()
    bench.pass_time(0.02)
    assert bench.state() is LineState.DOWN
    assert "nothing received for 0.41 s" in (bench.robot.problem or "")
    assert bench.heard() == []
    bench.run(1.0, t_us=t_us + 600_000)
    assert bench.state() is LineState.READY
    assert only(bench.heard(), Drive) == []


def drive_on(bench: Bench, seconds: float, t_us: int, *, deaf: bool = False, flags: int = 0) -> int:
    """Drive at 20 Hz with a robot that names the DRIVE it took last, but for the time that it is deaf."""
    last = bench.last_drive
    for _ in range(round(seconds / 0.05)):
        bench.robot.drive(Twist(0.1, 0.0))
        taken = [frame.seq for frame in bench.answer() if isinstance(frame, Drive)]
        last = last if deaf else taken[-1] if taken else last
        bench.now += 0.05
        t_us += 50_000
        bench.odom(t_us, last_drive_seq=last, flags=flags)
        bench.say(Echo(0, t_us, 0, 1, (10,)))
        bench.robot.tick(bench.now)
    bench.last_drive = last
    return t_us


def test_a_robot_that_talks_on_but_takes_no_drive_is_down(bench: Bench) -> None:
    t_us = drive_on(bench, 1.0, 0)
    assert bench.state() is LineState.READY
    drive_on(bench, 0.3, t_us, deaf=True)
    assert bench.state() is LineState.READY
    drive_on(bench, 0.1, t_us + 300_000, deaf=True)
    assert bench.state() is LineState.DOWN
    assert "sends but has not acknowledged a DRIVE for 0.35 s" in (bench.robot.problem or "")
    assert "check the cable" in (bench.robot.problem or "")


def test_a_robot_that_never_names_the_drive_it_took_is_not_held_to_it(bench: Bench) -> None:
    drive_on(bench, 30.0, 0, deaf=True)
    assert bench.state() is LineState.READY


def test_a_latched_robot_takes_no_drive_and_that_is_no_trouble(bench: Bench) -> None:
    t_us = drive_on(bench, 1.0, 0)
    drive_on(bench, 2.0, t_us, deaf=True, flags=1)
    assert bench.state() is LineState.READY


def test_lost_frames_are_no_deafness(bench: Bench) -> None:
    t_us = drive_on(bench, 1.0, 0)
    for _ in range(20):
        t_us = drive_on(bench, 0.25, t_us, deaf=True)
        t_us = drive_on(bench, 0.05, t_us)
    assert bench.state() is LineState.READY


@pytest.mark.parametrize("boot_id", [IDENT.boot_id, 0xB002])
def test_a_robot_whose_ring_has_fallen_silent_is_asked_who_it_is(bench: Bench, boot_id: int) -> None:
    """A restart just as the clock wraps shows in nothing but that: the pattern is gone, and the odometry goes on."""
    t_us = bench.run(0.45, t_us=2**32 - 500_000)
    bench.robot.take_received()
    bench.ident = replace(IDENT, boot_id=boot_id)
    heard: list[Frame] = []
    for _ in range(10):
        t_us += PERIOD_US
        bench.now += 0.02
        bench.odom(t_us)
        bench.robot.tick(bench.now)
        heard += bench.answer()
    heard += bench.answer()
    restarted = boot_id != IDENT.boot_id
    assert [type(frame) for frame in heard] == ([Hello, Pattern] if restarted else [Hello])
    assert bench.robot.take_received().rebooted == restarted
    assert bench.state() is LineState.READY
    assert bench.robot.problem is None


def test_a_silent_ring_is_asked_about_at_a_modest_pace(bench: Bench) -> None:
    hellos, t_us = 0, 0
    for _ in range(500):
        t_us += PERIOD_US
        bench.now += 0.02
        bench.odom(t_us)
        bench.robot.tick(bench.now)
        hellos += len(only(bench.heard(), Hello))
    assert bench.state() is LineState.READY, "no one need answer"
    assert 15 <= hellos <= 20


def test_missing_odometry_alone_is_down_too(bench: Bench) -> None:
    for _ in range(30):
        bench.pass_time(0.02)
        bench.say(Echo(0, 5, 0, 1, (10,)))
    assert bench.state() is LineState.DOWN
    assert "no odometry" in (bench.robot.problem or "")


def test_an_echo_just_after_the_last_odometry_does_not_make_it_a_robot_that_talks(bench: Bench) -> None:
    t_us = bench.run(0.2, t_us=0)
    bench.pass_time(0.01)
    bench.say(Echo(0, t_us, 0, 1, (10,)))
    bench.pass_time(0.4)
    assert bench.state() is LineState.DOWN
    assert "nothing received" in (bench.robot.problem or "")


def test_a_restart_between_two_lines_is_noticed(bench: Bench) -> None:
    bench.odom(5_000_000)
    bench.say(Echo(0, 5_000_000, 0, 1, (10,)))
    bench.robot.line_closed()
    assert bench.state() is LineState.CLOSED
    bench.now += 1.0
    bench.ident = replace(IDENT, boot_id=0xB002)
    bench.open()
    bench.odom(20_000)
    bench.greet()
    heard = bench.robot.take_received()
    assert heard.rebooted
    assert heard.firings == ()
    assert heard.odometry is None
    bench.odom(40_000)
    heard = bench.robot.take_received()
    assert not heard.rebooted
    assert heard.odometry is not None
    assert heard.odometry.robot_s == pytest.approx(0.04)


@pytest.mark.parametrize("boot_id", [0xB002, IDENT.boot_id])
def test_a_restart_in_mid_run_is_noticed_by_the_clock(bench: Bench, boot_id: int) -> None:
    bench.run(2.0, t_us=3_000_000)
    bench.say(Echo(0, 5_000_000, 0, 1, (10,)))
    bench.robot.drive(Twist(0.1, 0.0))
    bench.ident = replace(IDENT, boot_id=boot_id)
    bench.pass_time(0.2)
    bench.odom(20_000, x_0p1mm=5)
    assert bench.state() is LineState.HANDSHAKE
    bench.odom(40_000, x_0p1mm=6)
    assert [type(frame) for frame in bench.answer()] == [Hello]
    assert [type(frame) for frame in bench.answer()] == [Pattern]
    assert bench.state() is LineState.READY
    heard = bench.robot.take_received()
    assert heard.rebooted
    assert heard.firings == ()
    assert heard.odometry is None
    bench.odom(60_000, x_0p1mm=7)
    bench.odom(80_000, x_0p1mm=9)
    bench.say(Echo(0, 70_000, 0, 1, (10,)))
    (firing,) = bench.robot.take_received().firings
    assert (firing.robot_s, firing.pose.x) == pytest.approx((0.07, 0.0008))


def test_a_restart_that_announces_itself_is_noticed(bench: Bench) -> None:
    bench.odom(5_000_000)
    bench.robot.drive(Twist(0.1, 0.0))
    bench.say(replace(IDENT, boot_id=0xB002))
    assert bench.state() is LineState.HANDSHAKE
    assert [type(frame) for frame in bench.answer()] == [Pattern]
    assert bench.robot.take_received().rebooted


def test_a_second_answer_to_the_greeting_changes_nothing(bench: Bench) -> None:
    bench.odom(5_000_000)
    bench.say(IDENT)
    assert bench.state() is LineState.READY
    assert bench.heard() == []
    assert not bench.robot.take_received().rebooted


@pytest.mark.parametrize(("t_us", "x"), [(9_000_000, 0), (1_020_000, 50_000)])
def test_a_clock_or_pose_that_leaps_is_asked_about_and_not_joined_to_the_past(
    bench: Bench, t_us: int, x: int
) -> None:
    bench.odom(1_000_000)
    bench.pass_time(0.02)
    bench.odom(t_us, x_0p1mm=x)
    assert bench.state() is LineState.HANDSHAKE
    bench.greet()
    assert not bench.robot.take_received().rebooted
    bench.odom(t_us + PERIOD_US, x_0p1mm=x)
    assert bench.state() is LineState.READY
    bench.say(Echo(0, t_us + 10_000, 0, 1, (10,)))
    heard = bench.robot.take_received()
    assert heard.firings == (), "the place of the echo is unknown"
    assert heard.odometry is not None
    assert heard.odometry.pose == Pose(x * 1e-4, 0.0, 0.0)
    assert bench.robot.late_echoes == 1
