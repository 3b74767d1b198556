"""Velocities, HALT and RELEASE to a Denning in virtual time: the newest wins, HALT goes first, limits hold."""

from __future__ import annotations

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
from tests.drivers.driver_harness import IDENT, DriverHarness, only


def test_only_the_newest_drive_is_sent_within_the_limits_of_the_body(harness: DriverHarness) -> None:
    harness.robot.drive(Twist(0.1, 0.2))
    harness.robot.drive(Twist(0.3054, -0.25))
    (drive,) = harness.received()
    assert isinstance(drive, Drive)
    assert (drive.v_mm_s, drive.w_mrad_s) == (305, -250)
    assert harness.received() == []
    harness.robot.drive(Twist(1e9, -1e9))
    (drive,) = harness.received()
    assert isinstance(drive, Drive)
    assert (drive.v_mm_s, drive.w_mrad_s) == (600, -1000)


def test_a_stalled_line_takes_only_halt(harness: DriverHarness) -> None:
    harness.robot.drive(Twist(0.1, 0.0))
    harness.robot.release()
    assert harness.received(writable=False) == []
    harness.robot.halt()
    (halt,) = harness.received(writable=False)
    assert isinstance(halt, Halt)


def test_after_a_stalled_line_only_the_newest_drive_is_sent(harness: DriverHarness) -> None:
    for v in (0.1, 0.2, 0.3):
        harness.robot.drive(Twist(v, 0.0))
        assert harness.received(writable=False) == []
    (drive,) = harness.received()
    assert isinstance(drive, Drive)
    assert drive.v_mm_s == 300


def test_halt_is_sent_first_and_discards_earlier_requests(harness: DriverHarness) -> None:
    harness.robot.release()
    harness.robot.drive(Twist(0.1, 0.0))
    harness.robot.halt()
    heard = harness.received()
    assert [type(frame) for frame in heard] == [Halt]
    harness.robot.drive(Twist(0.1, 0.0))
    assert harness.received() == [], "nothing drives past a HALT that may not have been heard"
    harness.send(Ack(0, heard[0].seq))
    harness.robot.drive(Twist(0.1, 0.0))
    assert [type(frame) for frame in harness.received()] == [Drive]


def test_halt_is_sent_before_hello() -> None:
    harness = DriverHarness()
    harness.robot.halt()
    harness.open()
    assert [type(frame) for frame in harness.received()] == [Halt, Hello]


def test_halt_is_repeated_until_acknowledged(harness: DriverHarness) -> None:
    harness.robot.halt()
    halts = 0
    for _ in range(100):
        harness.robot.halt()
        halts += len(only(harness.received(), Halt))
        harness.pass_time(0.02)
    assert harness.state() is LineState.DOWN
    assert 15 <= halts <= 25, "and not once a cycle"
    harness.robot.line_closed()
    harness.open()
    heard = harness.answer()
    assert [type(frame) for frame in heard] == [Halt, Hello]
    assert [type(frame) for frame in harness.answer()] == [Pattern]
    harness.pass_time(0.3)
    assert harness.received() == []
    assert harness.state() is LineState.READY


@pytest.mark.parametrize(
    ("sends", "what"),
    [(True, "although the robot sends other frames"), (False, "and nothing is received; the robot is off")],
)
def test_a_robot_that_answers_all_but_halt_is_down(sends: bool, what: str) -> None:
    """A robot that froze sent frames before the HALT, and none since."""
    harness = DriverHarness()
    harness.robot.halt()
    harness.open()
    harness.received()
    harness.send(IDENT)
    (pattern,) = only(harness.received(), Pattern)
    harness.send(Ack(0, pattern.seq))
    assert harness.state() is LineState.READY
    for k in range(20):
        harness.received()
        harness.pass_time(0.02)
        if sends:
            harness.odom(20_000 * k)
    assert harness.state() is LineState.DOWN
    assert f"no answer to 3 HALT commands {what}" in (harness.robot.problem or "")


def test_release_clears_a_pending_halt_without_waiting(harness: DriverHarness) -> None:
    harness.robot.halt()
    harness.received()
    harness.robot.release()
    heard = harness.answer()
    assert [type(frame) for frame in heard] == [Release]
    harness.pass_time(0.2)
    assert harness.received() == []
    harness.robot.line_closed()
    harness.robot.release()
    harness.open()
    assert [type(frame) for frame in harness.answer()] == [Hello], "a release is not kept for later"


def test_a_drive_refused_because_of_the_latch_is_not_a_problem(harness: DriverHarness) -> None:
    harness.robot.drive(Twist(0.1, 0.0))
    (drive,) = harness.received()
    harness.send(Nak(0, drive.seq, NakCode.LATCHED))
    assert (harness.state(), harness.robot.problem) == (LineState.READY, None)
    harness.robot.drive(Twist(0.1, 0.0))
    (drive,) = harness.received()
    harness.send(Nak(0, drive.seq, NakCode.VALUE_OUT_OF_RANGE))
    assert harness.state() is LineState.READY
    assert "refuses DRIVE (NAK 3)" in (harness.robot.problem or "")
    assert "body.speed_max_m_s" in (harness.robot.problem or "")
    harness.robot.release()
    harness.answer()
    assert harness.robot.problem is None


def test_a_refused_release_is_reported_and_not_repeated(harness: DriverHarness) -> None:
    harness.robot.release()
    (release,) = harness.received()
    harness.send(Nak(0, release.seq, NakCode.LATCHED))
    assert harness.state() is LineState.READY
    assert "refuses RELEASE (NAK 4): it is latched; remove the cause" in (harness.robot.problem or "")
    harness.pass_time(0.2)
    assert harness.received() == []
