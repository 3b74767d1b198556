"""Velocities, HALT and RELEASE to a Denning in virtual time: the newest wins, HALT goes first, limits hold."""

from __future__ import annotations

import math

import pytest

from drivers.denning.frames import (
    Ack,
    Drive,
    Halt,
    Hello,
    Nak,
    NakCode,
    Pattern,
    Release,
)
from drivers.driver import LineState
from drivers.messages import Twist
from tests.drivers.scripted import CONFIG, IDENT, Bench, only


def test_the_newest_drive_wins_and_is_held_to_the_limits_of_the_body(bench: Bench) -> None:
    bench.robot.drive(Twist(0.1, 0.2))
    bench.robot.drive(Twist(0.3054, -0.25))
    (drive,) = bench.heard()
    assert isinstance(drive, Drive)
    assert (drive.v_mm_s, drive.w_mrad_s) == (305, -250)
    assert bench.heard() == []
    bench.robot.drive(Twist(1e9, -1e9))
    (drive,) = bench.heard()
    assert isinstance(drive, Drive)
    assert (drive.v_mm_s, drive.w_mrad_s) == (600, -1000)


def test_a_limit_is_not_passed_by_rounding() -> None:
    body = CONFIG.body.model_copy(update={"speed_max_m_s": 0.3057, "turn_max_rad_s": 40.0})
    bench = Bench(CONFIG.model_copy(update={"body": body}))
    bench.open()
    bench.greet()
    bench.robot.drive(Twist(0.3057, 39.0))
    (drive,) = bench.heard()
    assert isinstance(drive, Drive)
    assert (drive.v_mm_s, drive.w_mrad_s) == (305, 32767)


@pytest.mark.parametrize("twist", [Twist(math.nan, 0.0), Twist(0.0, math.inf)])
def test_a_velocity_that_is_none_is_refused(bench: Bench, twist: Twist) -> None:
    with pytest.raises(ValueError, match="must be finite"):
        bench.robot.drive(twist)
    assert bench.heard() == []


def test_a_stalled_line_takes_only_halt(bench: Bench) -> None:
    bench.robot.drive(Twist(0.1, 0.0))
    bench.robot.release()
    assert bench.heard(writable=False) == []
    bench.robot.halt()
    (halt,) = bench.heard(writable=False)
    assert isinstance(halt, Halt)


def test_the_drive_that_waited_for_the_line_is_the_newest(bench: Bench) -> None:
    for v in (0.1, 0.2, 0.3):
        bench.robot.drive(Twist(v, 0.0))
        assert bench.heard(writable=False) == []
    (drive,) = bench.heard()
    assert isinstance(drive, Drive)
    assert drive.v_mm_s == 300


def test_halt_goes_first_and_drops_what_was_asked_before(bench: Bench) -> None:
    bench.robot.release()
    bench.robot.drive(Twist(0.1, 0.0))
    bench.robot.halt()
    heard = bench.heard()
    assert [type(frame) for frame in heard] == [Halt]
    bench.robot.drive(Twist(0.1, 0.0))
    assert bench.heard() == [], "nothing drives past a HALT that may not have been heard"
    bench.say(Ack(0, heard[0].seq))
    bench.robot.drive(Twist(0.1, 0.0))
    assert [type(frame) for frame in bench.heard()] == [Drive]


def test_halt_goes_before_the_greeting() -> None:
    bench = Bench()
    bench.robot.halt()
    bench.open()
    assert [type(frame) for frame in bench.heard()] == [Halt, Hello]


def test_halt_is_repeated_until_answered_whatever_happens(bench: Bench) -> None:
    bench.robot.halt()
    halts = 0
    for _ in range(100):
        bench.robot.halt()
        halts += len(only(bench.heard(), Halt))
        bench.pass_time(0.02)
    assert bench.state() is LineState.DOWN
    assert 15 <= halts <= 25, "and not once a cycle"
    bench.robot.line_closed()
    bench.open()
    heard = bench.answer()
    assert [type(frame) for frame in heard] == [Halt, Hello]
    assert [type(frame) for frame in bench.answer()] == [Pattern]
    bench.pass_time(0.3)
    assert bench.heard() == []
    assert bench.state() is LineState.READY


def test_a_robot_that_answers_all_but_halt_is_down() -> None:
    bench = Bench()
    bench.robot.halt()
    bench.open()
    bench.heard()
    bench.say(IDENT)
    (pattern,) = only(bench.heard(), Pattern)
    bench.say(Ack(0, pattern.seq))
    assert bench.state() is LineState.READY
    for _ in range(20):
        bench.heard()
        bench.pass_time(0.02)
    assert bench.state() is LineState.DOWN
    assert "no answer to 3 HALT commands although the robot sends" in (bench.robot.problem or "")


def test_release_clears_a_pending_halt_without_waiting(bench: Bench) -> None:
    bench.robot.halt()
    bench.heard()
    bench.robot.release()
    heard = bench.answer()
    assert [type(frame) for frame in heard] == [Release]
    bench.pass_time(0.2)
    assert bench.heard() == []
    bench.robot.line_closed()
    bench.robot.release()
    bench.open()
    assert [type(frame) for frame in bench.answer()] == [Hello], "a release is not kept for later"


def test_while_latched_a_refused_drive_is_no_trouble(bench: Bench) -> None:
    bench.robot.drive(Twist(0.1, 0.0))
    (drive,) = bench.heard()
    bench.say(Nak(0, drive.seq, NakCode.LATCHED))
    assert (bench.state(), bench.robot.problem) == (LineState.READY, None)
    bench.robot.drive(Twist(0.1, 0.0))
    (drive,) = bench.heard()
    bench.say(Nak(0, drive.seq, NakCode.VALUE_OUT_OF_RANGE))
    assert bench.state() is LineState.READY
    assert "refuses DRIVE (NAK 3)" in (bench.robot.problem or "")
    assert "body.speed_max_m_s" in (bench.robot.problem or "")
    bench.robot.release()
    bench.answer()
    assert bench.robot.problem is None


def test_a_refused_release_is_reported_and_not_repeated(bench: Bench) -> None:
    bench.robot.release()
    (release,) = bench.heard()
    bench.say(Nak(0, release.seq, NakCode.LATCHED))
    assert bench.state() is LineState.READY
    assert "refuses RELEASE (NAK 4): it is latched; remove the cause" in (bench.robot.problem or "")
    bench.pass_time(0.2)
    assert bench.heard() == []
