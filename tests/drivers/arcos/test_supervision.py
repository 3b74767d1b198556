"""Stopping until it is seen, enabling only when released, and a receiver that must answer now and then."""

from __future__ import annotations

from dataclasses import replace

from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.frames import SipFlags
from drivers.arcos.handshake import STOP
from drivers.arcos.supervision import Enabling, Halting, ReceiverMonitor
from tests.drivers.arcos.vectors import TAIL

N = CommandNumber
OFF = (*STOP, Command(N.ENABLE, 0))
ON_STATUS, OFF_STATUS = SipFlags(0x1F), SipFlags(0x1E)
MOVING = replace(TAIL, flags=0x1F, left=200, right=180)
STANDING = replace(TAIL, flags=0x1F)
TURNING = replace(TAIL, flags=0x1F, left=-90, right=90)


def test_a_stop_is_repeated_until_the_base_stands_and_then_its_motors_go_off() -> None:
    halting = Halting()
    assert halting.commands(0.0) == ()
    halting.observe(STANDING)
    halting.start()
    halting.observe(TAIL)
    assert halting.is_active, "this SIP is from before the stop was sent"
    assert halting.commands(1.0) == STOP
    assert halting.commands(1.05) == ()
    for sip in (MOVING, TURNING):
        halting.observe(sip)
    assert halting.commands(1.1) == STOP
    halting.observe(STANDING)
    assert halting.is_active, "a velocity may be under way"
    assert halting.commands(1.11) == OFF
    halting.observe(TAIL)
    assert halting.commands(2.0) == ()
    assert halting.moving_s(9.0) == 0.0


def test_a_base_that_does_not_obey_loses_its_motors_in_motion() -> None:
    halting = Halting()
    halting.start()
    sent = []
    for k in range(300):
        sent.append(halting.commands(0.01 * k))
        halting.observe(MOVING)
    assert OFF not in sent[:100]
    assert OFF in sent[100:112]
    assert halting.moving_s(2.99) == 2.99
    halting.observe(replace(MOVING, flags=0x1E))
    assert halting.is_active, "it rolls"


def test_a_new_halt_is_sent_at_once() -> None:
    halting = Halting()
    halting.start()
    assert halting.commands(0.0) == STOP
    halting.start()
    assert halting.commands(0.01) == STOP
    halting.cancel()
    assert halting.commands(0.5) == ()


def test_motors_are_switched_on_until_they_are_reported_on() -> None:
    enabling = Enabling()
    assert enabling.commands(0.0) == ()
    enabling.release()
    assert enabling.commands(0.0) == (Command(N.ENABLE, 1),)
    assert enabling.commands(0.29) == ()
    enabling.observe(OFF_STATUS, 0.3)
    assert enabling.commands(0.31) == (Command(N.ENABLE, 1),)
    assert enabling.tries == 2
    enabling.observe(ON_STATUS, 0.5)
    assert enabling.may_drive
    assert (enabling.tries, enabling.commands(9.0)) == (0, ())


def test_motors_that_are_about_to_go_off_are_switched_on_too() -> None:
    enabling = Enabling()
    enabling.observe(ON_STATUS, 0.0)
    enabling.release()
    assert enabling.commands(0.0) == (Command(N.ENABLE, 1),)
    for run_s, status in ((0.05, ON_STATUS), (0.15, OFF_STATUS)):
        enabling.observe(status, run_s)
        assert not enabling.may_drive
    enabling.observe(ON_STATUS, 0.25)
    assert enabling.may_drive


def test_motors_that_something_switched_off_stay_off() -> None:
    enabling = Enabling()
    enabling.release()
    enabling.commands(0.0)
    for run_s, status in ((0.2, ON_STATUS), (0.3, SipFlags(0x3E)), (0.4, ON_STATUS)):
        enabling.observe(status, run_s)
    assert not enabling.may_drive, "the STOP button was pressed and released"
    assert enabling.commands(9.0) == ()


def test_a_receiver_that_answered_once_must_go_on_to_answer() -> None:
    monitor = ReceiverMonitor()
    assert monitor.commands(0.0) == (Command(N.ENCODER, 1),)
    monitor.answered()
    assert monitor.commands(0.2) == ()
    assert monitor.commands(0.25) == (Command(N.ENCODER, 1),)
    monitor.commands(0.5)
    assert monitor.unanswered_s(0.6) == 0.35
    monitor.answered()
    assert monitor.unanswered_s(0.7) == 0.0


def test_a_robot_that_never_answers_is_asked_eight_times() -> None:
    monitor = ReceiverMonitor()
    sent = sum(bool(monitor.commands(0.1 * k)) for k in range(1000))
    assert sent == 8
    assert monitor.unanswered_s(100.0) == 0.0
