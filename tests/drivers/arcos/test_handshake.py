"""The start of a session: order, repetition, speeds of the line, robots that are open already or say little."""

from __future__ import annotations

import pytest

from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.frames import ConfigPacket, Packet, RobotName, SyncEcho
from drivers.arcos.handshake import STOP, Handshake, Stage
from tests.drivers.arcos.harness import P3DX_FILE
from tests.drivers.arcos.vectors import P3DX, TAIL

N = CommandNumber
LINK = P3DX_FILE.link
SYNC0 = (Command(N.PULSE),)
AGAIN = (*STOP, *SYNC0)
LISTENED_S = 0.25


def started(*, has_speed: bool = True) -> Handshake:
    """Return a handshake that has listened to a silent line."""
    handshake = Handshake(LINK, has_speed=has_speed)
    handshake.start(-LISTENED_S)
    assert handshake.commands() == ()
    handshake.tick(0.0)
    return handshake


def named(*, has_speed: bool = True) -> Handshake:
    handshake = started(has_speed=has_speed)
    for packet in (SyncEcho(0), SyncEcho(1), RobotName("a", "Pioneer", "p3dx")):
        handshake.commands()
        handshake.take(packet)
    return handshake


def waited(handshake: Handshake, begin_s: float, seconds: float) -> list[tuple[Command, ...]]:
    """Let time pass in steps of 10 ms; return what is sent."""
    sent = []
    for k in range(1, round(seconds / 0.01) + 1):
        handshake.tick(begin_s + 0.01 * k)
        if commands := handshake.commands():
            sent.append(commands)
    return sent


def test_each_sync_follows_the_answer_to_the_one_before() -> None:
    handshake = started()
    assert handshake.commands() == SYNC0
    assert handshake.commands() == ()
    handshake.take(SyncEcho(1))
    assert handshake.commands() == (), "the echo of an earlier session"
    handshake.take(SyncEcho(0))
    assert handshake.commands() == (Command(N.OPEN),)
    handshake.take(SyncEcho(0))
    assert handshake.commands() == ()
    handshake.take(SyncEcho(1))
    assert handshake.commands() == (Command(N.CLOSE),)
    handshake.take(RobotName("a", "Pioneer", "p3dx"))
    assert handshake.commands() == (Command(N.OPEN, 1), Command(N.CONFIG, 1))
    handshake.take(TAIL)
    assert handshake.stage is Stage.CONFIG
    handshake.take(P3DX)
    assert handshake.config == P3DX
    assert handshake.commands() == (Command(N.HOSTBAUD, 2),)


def test_the_line_follows_to_the_faster_speed_after_the_command_has_left() -> None:
    handshake = named()
    handshake.commands()
    handshake.take(P3DX)
    handshake.tick(1.0)
    handshake.commands()
    handshake.tick(1.04)
    assert handshake.baud == 9600
    handshake.tick(1.05)
    assert handshake.baud == 38400
    assert handshake.commands() == (Command(N.PULSE),)
    handshake.take(TAIL)
    assert handshake.stage is Stage.DONE
    assert not handshake.keeps_baud


def test_a_robot_that_does_not_follow_keeps_its_speed() -> None:
    handshake = named()
    handshake.commands()
    handshake.take(P3DX)
    waited(handshake, 0.0, 0.9)
    assert handshake.baud == 38400
    waited(handshake, 0.9, 0.2)
    assert (handshake.baud, handshake.stage, handshake.keeps_baud) == (9600, Stage.DONE, True)


@pytest.mark.parametrize("config", [ConfigPacket(auto_baud=0), ConfigPacket(auto_baud=1), ConfigPacket()])
def test_only_a_robot_that_allows_it_changes_its_speed(config: ConfigPacket) -> None:
    handshake = named()
    handshake.take(config)
    assert (handshake.stage, handshake.baud) == (Stage.DONE, 9600)


def test_a_line_without_a_speed_is_never_changed() -> None:
    handshake = named(has_speed=False)
    handshake.take(P3DX)
    assert handshake.stage is Stage.DONE
    assert handshake.bauds == ()


def test_without_an_answer_all_speeds_are_tried_twice_each() -> None:
    handshake = started()
    bauds = list[int]()
    for k in range(400):
        handshake.tick(0.01 * k)
        if commands := handshake.commands():
            assert commands == (AGAIN if len(bauds) % 2 else SYNC0)
            bauds.append(handshake.baud)
        if handshake.sweeps:
            break
    assert bauds[:10] == [baud for baud in (9600, 38400, 115200, 19200, 57600) for _ in range(2)]
    assert k * 0.01 < 3.0
    handshake.restart(5.0)
    assert handshake.baud == 9600


def test_after_an_interruption_the_present_speed_comes_first() -> None:
    handshake = started()
    handshake.baud = 38400
    handshake.restart(0.0)
    bauds = []
    for k in range(300):
        handshake.tick(0.01 * k)
        if handshake.commands():
            bauds.append(handshake.baud)
    assert bauds[:6] == [38400, 38400, 9600, 9600, 115200, 115200]


def test_a_robot_in_a_session_is_closed_first() -> None:
    handshake = started()
    handshake.commands()
    handshake.take(TAIL)
    assert handshake.was_open
    assert handshake.commands() == (*STOP, Command(N.CLOSE, 1)), "it may be moving"
    handshake.take(TAIL)
    assert waited(handshake, 0.0, 0.19) == []
    assert waited(handshake, 0.19, 0.25) == [], "listens again: it may have lost CLOSE"
    assert waited(handshake, 0.44, 0.03) == [SYNC0]


def test_an_unanswered_sync_is_repeated_and_then_all_begins_again() -> None:
    handshake = started()
    handshake.commands()
    handshake.take(SyncEcho(0))
    assert waited(handshake, 0.0, 0.6) == [(Command(N.OPEN),), (Command(N.OPEN),), AGAIN]


def test_the_configuration_is_requested_five_times_then_done_without() -> None:
    handshake = named()
    first = handshake.commands()
    handshake.take(TAIL)
    assert first == (Command(N.OPEN, 1), Command(N.CONFIG, 1))
    assert waited(handshake, 0.0, 1.2) == [(Command(N.CONFIG, 1),)] * 4
    assert (handshake.stage, handshake.config) == (Stage.DONE, None)


def test_open_is_repeated_until_sips_come_and_without_any_all_begins_again() -> None:
    handshake = named()
    sent = [handshake.commands(), *waited(handshake, 0.0, 1.2)]
    assert sent == [(Command(N.OPEN, 1), Command(N.CONFIG, 1))] * 5 + [AGAIN]


def test_a_robot_that_only_echoes_sync2_has_no_name() -> None:
    handshake = started()
    for packet in (SyncEcho(0), SyncEcho(1), RobotName()):
        handshake.take(packet)
    assert handshake.stage is Stage.CONFIG


def test_a_robot_in_a_session_is_heard_and_stopped_before_anything_else_is_sent() -> None:
    handshake = Handshake(LINK, has_speed=True)
    handshake.start(0.0)
    assert waited(handshake, 0.0, 0.1) == []
    handshake.take(TAIL)
    assert handshake.commands() == (*STOP, Command(N.CLOSE, 1))


def test_bytes_at_another_speed_may_be_those_of_a_robot_in_a_session() -> None:
    handshake = Handshake(LINK, has_speed=True)
    handshake.start(0.0)
    handshake.hear_noise()
    assert handshake.commands() == AGAIN, "at once"
    assert set(waited(handshake, 0.0, 2.0)) == {AGAIN}, "at every speed"


def test_bytes_of_a_greeting_on_a_line_without_a_speed_are_no_session() -> None:
    handshake = Handshake(LINK, has_speed=False)
    handshake.start(0.0)
    handshake.hear_noise()
    assert waited(handshake, 0.0, 1.0) == [SYNC0]


def test_over_a_network_an_answer_has_a_second_to_come() -> None:
    handshake = started(has_speed=False)
    assert waited(handshake, 0.0, 0.99) == [SYNC0]
    assert waited(handshake, 0.99, 0.02) == [AGAIN]


def test_a_session_that_was_lost_on_the_same_line_is_stopped_at_once() -> None:
    handshake = named()
    handshake.restart(3.0)
    assert handshake.commands() == AGAIN


@pytest.mark.parametrize("stage", [Stage.SYNC1, Stage.SYNC2, Stage.CONFIG, Stage.CLOSING])
def test_a_stage_that_is_never_answered_is_counted(stage: Stage) -> None:
    handshake = started()
    answers: dict[Stage, Packet] = {
        Stage.SYNC0: SyncEcho(0),
        Stage.SYNC1: SyncEcho(1),
        Stage.SYNC2: RobotName("a", "Pioneer", "p3dx"),
    }
    if stage is Stage.CLOSING:
        answers = dict.fromkeys((Stage.LISTENING, *answers), TAIL)
    for k in range(400):
        handshake.tick(0.01 * k)
        if handshake.commands() and handshake.stage in answers and handshake.stage is not stage:
            handshake.take(answers[handshake.stage])
    assert handshake.failures >= 2
    assert handshake.unanswered is stage
