"""The brake is set once the base stands, and released until that is reported; a base that does not follow."""

from __future__ import annotations

from config.load import load_robot
from drivers.messages import Twist
from drivers.rflex.codec import BRAKE_RELEASE, BRAKE_SET, MOTOR_SET_DIR, STATUS_REQUEST, Frame, direction_of
from drivers.rflex.supervision import Brake, Mode, StallMonitor

B21R = load_robot("b21r")
STILL = Twist(0.0, 0.0)


def sent(brake: Brake, from_s: float, to_s: float) -> list[Frame]:
    steps = range(round(100 * from_s), round(100 * to_s))
    return [frame for k in steps if (frame := brake.due(0.01 * k)) is not None]


def mode(brake: Brake) -> Mode:
    return brake.mode


def stalled(stall: StallMonitor) -> bool:
    return stall.is_stalled


def test_a_halt_stops_and_then_brakes() -> None:
    brake = Brake(B21R)
    brake.halt()
    brake.observe_speed(Twist(0.3, 0.0))
    first = sent(brake, 0.0, 0.05)
    assert [frame.opcode for frame in first] == [MOTOR_SET_DIR, MOTOR_SET_DIR, 1]
    brake.observe_speed(STILL)
    assert BRAKE_SET in sent(brake, 0.05, 0.1)
    brake.observe_status(0.06, on=True)
    assert mode(brake) is Mode.HALTING, "that may be from before"
    brake.observe_status(0.12, on=True)
    assert mode(brake) is Mode.HELD
    assert set(sent(brake, 0.2, 0.5)) == {STATUS_REQUEST}
    brake.observe_status(0.5, on=False)
    assert mode(brake) is Mode.HALTING, "something else released it"


def test_a_base_that_does_not_obey_is_braked_in_motion() -> None:
    brake = Brake(B21R)
    brake.halt()
    moving = sent(brake, 0.0, 1.0)
    assert BRAKE_SET not in moving
    assert {direction_of(frame)[1] for frame in moving if frame.opcode == MOTOR_SET_DIR} == {0, 1}
    assert BRAKE_SET in sent(brake, 1.0, 1.2)
    assert brake.halting_s(1.2) == 1.2


def test_a_release_is_repeated_until_it_is_reported() -> None:
    brake = Brake(B21R)
    brake.release()
    assert sent(brake, 0.0, 0.3).count(BRAKE_RELEASE) == 3
    assert (brake.tries, brake.may_drive) == (3, False)
    brake.observe_status(0.3, on=False)
    assert mode(brake) is Mode.RELEASED
    assert brake.may_drive
    brake.observe_status(0.4, on=True)
    assert mode(brake) is Mode.HELD, "an emergency stop"
    brake.release()
    brake.forget()
    assert mode(brake) is Mode.HELD
    brake.halt()
    brake.forget()
    assert mode(brake) is Mode.HALTING


def test_a_base_that_does_not_follow_is_stalled() -> None:
    stall = StallMonitor()
    stall.command(Twist(-0.3, 0.0), 0.0)
    stall.observe(STILL, 0.3)
    assert not stalled(stall), "it accelerates"
    stall.observe(Twist(-0.2, 0.0), 0.5)
    assert not stalled(stall)
    stall.observe(STILL, 0.6)
    assert stalled(stall)
    stall.stop()
    stall.observe(STILL, 2.0)
    assert not stalled(stall)
    stall.command(Twist(0.0, 0.5), 2.0)
    stall.observe(STILL, 2.5)
    assert stalled(stall)
    stall.command(Twist(0.01, 0.1), 2.6)
    stall.observe(STILL, 3.5)
    assert not stalled(stall), "too slow to judge by"
