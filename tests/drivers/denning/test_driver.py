"""The conversation with a Denning in virtual time: greeting, firing pattern, who it is, and what is counted."""

from __future__ import annotations

from dataclasses import replace

import pytest

from config.robot import FiringConfig
from drivers.denning.codec import Decoder, encode
from drivers.denning.driver import DenningDriver
from drivers.denning.frames import (
    Ack,
    Echo,
    Hello,
    Ident,
    Nak,
    NakCode,
    Pattern,
)
from drivers.driver import LineState, RobotDriver
from drivers.firing_pattern import FiringError
from drivers.messages import LinkCounts, Twist
from tests.drivers.scripted import CONFIG, IDENT, ODOM, PERIOD_US, Bench, only
from tests.drivers.vectors import OCTETS


def test_it_is_a_robot_driver() -> None:
    driver: RobotDriver = DenningDriver(CONFIG)
    assert driver.state is LineState.CLOSED
    assert driver.outgoing(writable=True) == b""


def test_greeting_then_pattern_then_ready() -> None:
    bench = Bench()
    bench.open()
    assert bench.state() is LineState.HANDSHAKE
    first = bench.robot.outgoing(writable=True)
    assert first[0] == 0, "a zero ends what an earlier user left half said"
    assert Decoder("host").feed(first) == [Hello(0, 1)]
    assert bench.heard() == []
    bench.say(IDENT)
    assert bench.state() is LineState.HANDSHAKE
    assert bench.heard() == [Pattern(1, 50, 255, OCTETS)]
    bench.say(Ack(0, 1))
    assert bench.state() is LineState.READY
    assert bench.robot.problem is None
    identity = bench.robot.identity
    assert identity is not None
    assert (identity.name, identity.sensors, identity.boot_id) == ("denning", 24, 0xB001)
    assert (identity.ring_radius_m, identity.deadman_s, identity.odometry_period_s) == pytest.approx(
        (0.381, 0.5, 0.02)
    )
    assert bench.robot.counts == LinkCounts(frames=2)
    assert not bench.robot.take_received().rebooted


def test_what_comes_before_the_greeting_is_done_is_not_used() -> None:
    bench = Bench()
    bench.open()
    bench.odom(1_000_000)
    assert bench.robot.take_received().odometry is None, "whose odometry?"
    bench.heard()
    bench.say(IDENT)
    bench.odom(1_020_000)
    bench.say(Echo(0, 1_020_000, 0, 1, (10,)))
    bench.greet()
    bench.odom(1_040_000)
    heard = bench.robot.take_received()
    assert heard.odometry is not None
    assert heard.firings == (), "a firing of an earlier pattern"


def test_an_unanswered_command_is_sent_three_times_with_numbers_of_their_own() -> None:
    bench = Bench()
    bench.open()
    sent = []
    for _ in range(31):
        sent += bench.heard()
        bench.pass_time(0.01)
    assert sent == [Hello(0), Hello(1), Hello(2)]
    assert bench.device_lost == 0
    assert bench.state() is LineState.DOWN
    assert "no answer to 3 HELLO commands and nothing is received" in (bench.robot.problem or "")


def test_a_lost_ack_is_made_good_by_the_next_and_a_late_one_counts() -> None:
    bench = Bench()
    bench.open()
    bench.answer()
    (pattern,) = bench.heard()
    bench.pass_time(0.11)
    (again,) = bench.heard()
    assert isinstance(again, Pattern)
    assert again.masks == OCTETS
    assert again.seq != pattern.seq
    bench.say(Ack(0, pattern.seq))
    assert bench.state() is LineState.READY
    bench.say(Ack(0, again.seq))
    assert bench.state() is LineState.READY
    assert bench.robot.problem is None


def test_a_robot_that_comes_back_is_taken_up_at_a_modest_pace() -> None:
    bench = Bench()
    bench.open()
    hellos = 0
    for _ in range(1000):
        hellos += len(only(bench.heard(), Hello))
        bench.pass_time(0.01)
    assert bench.state() is LineState.DOWN
    assert 15 <= hellos <= 30
    while not only(heard := bench.heard(), Hello):
        bench.pass_time(0.01)
    assert len(heard) == 1
    bench.say(IDENT)
    assert bench.state() is LineState.HANDSHAKE
    assert bench.robot.problem is not None, "still says why it took so long"
    bench.answer()
    assert bench.state() is LineState.READY
    assert bench.robot.problem is None


@pytest.mark.parametrize(
    ("ident", "text"),
    [
        (replace(IDENT, version=2), "speaks version 2"),
        (replace(IDENT, sensors=16), "has 16 sensors and the robot file 24"),
        (replace(IDENT, ring_radius_mm=383), r"a radius of 0\.383 m and the robot file says 0\.381 m"),
    ],
)
def test_another_robot_than_expected_is_not_driven(ident: Ident, text: str) -> None:
    bench = Bench()
    bench.ident = ident
    bench.open()
    bench.answer()
    assert bench.state() is LineState.DOWN
    with pytest.raises(AssertionError, match=text):
        raise AssertionError(bench.robot.problem)
    bench.robot.drive(Twist(0.1, 0.0))
    assert bench.heard() == []
    bench.ident = replace(IDENT, ring_radius_mm=382)
    bench.pass_time(0.6)
    bench.greet()


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (NakCode.VALUE_OUT_OF_RANGE, "NAK 3.*: a value is out of its range; make ring.firing.step_period_s longer"),
        (NakCode.UNKNOWN_TYPE, "NAK 1.* does not know this command; check .* same version"),
        (99, "NAK 99.* a reason this program does not know"),
    ],
)
def test_a_refused_pattern_is_trouble(code: int, text: str) -> None:
    bench = Bench()
    bench.open()
    bench.answer()
    (pattern,) = bench.heard()
    bench.say(Nak(0, pattern.seq, code))
    assert bench.state() is LineState.DOWN
    with pytest.raises(AssertionError, match=text):
        raise AssertionError(bench.robot.problem)


def test_counts_go_on_over_lines(bench: Bench) -> None:
    bench.say(ODOM)
    bench.robot.receive(b"\x01\x02\x03\0", bench.now)
    bench.robot.receive(encode(replace(ODOM, seq=6)), bench.now)
    assert bench.robot.counts == LinkCounts(frames=4, bad=1, lost=3)
    bench.robot.line_closed()
    bench.robot.receive(encode(ODOM), bench.now)
    bench.open()
    bench.greet()
    assert bench.robot.counts == LinkCounts(frames=6, bad=1, lost=3)


def test_noise_instead_of_an_answer_points_at_the_baud_rate() -> None:
    bench = Bench()
    bench.open()
    for _ in range(40):
        bench.heard()
        bench.robot.receive(b"\x9f\x33\0", bench.now)
        bench.pass_time(0.01)
    assert "likely the baud rate" in (bench.robot.problem or "")


@pytest.mark.parametrize(
    ("broken", "message"), [(1, "nothing received for 0.41 s"), (9, "9 corrupt frames came in place of it: noise")]
)
def test_noise_in_place_of_odometry_is_named_and_one_broken_frame_is_not(
    bench: Bench, broken: int, message: str
) -> None:
    bench.robot.receive(b"\x9f\x33\0" * broken, bench.now)
    bench.pass_time(0.41)
    assert bench.state() is LineState.DOWN
    assert message in (bench.robot.problem or "")


def test_noise_in_place_of_echoes_is_named_once_they_are_overdue(bench: Bench) -> None:
    for k in range(30):
        bench.odom(k * PERIOD_US)
        bench.robot.receive(b"\x9f\x33\0" * (k % 2), bench.now)
        bench.pass_time(0.02)
        assert bench.robot.problem is None or k > 20
    assert "corrupt frames came in place of its echoes: noise" in (bench.robot.problem or "")
    bench.say(Echo(0, 29 * PERIOD_US, 0, 1, (10,)))
    assert bench.robot.problem is None


def test_another_firing_pattern_while_it_drives(bench: Bench) -> None:
    ring = CONFIG.ring.model_copy(update={"firing": FiringConfig(preset="quadrants", step_period_s=0.06)})
    bench.robot.set_firing(CONFIG.ring)
    assert bench.heard() == [], "the one under way is not said again"
    bench.robot.set_firing(ring)
    (pattern,) = only(bench.answer(), Pattern)
    assert isinstance(pattern, Pattern)
    assert (len(pattern.masks), pattern.step_period_ms) == (6, 60)
    assert bench.state() is LineState.READY
    bench.robot.line_closed()
    bench.open()
    (again,) = only([*bench.answer(), *bench.answer()], Pattern)
    assert replace(again, seq=pattern.seq) == pattern, "kept for the next line"


def test_another_firing_pattern_before_the_first_is_taken() -> None:
    """An answer to the first must not pass for one to the second."""
    bench = Bench()
    bench.open()
    bench.answer()
    (first,) = only(bench.heard(), Pattern)
    ring = CONFIG.ring.model_copy(update={"firing": FiringConfig(preset="quadrants", step_period_s=0.06)})
    bench.robot.set_firing(ring)
    bench.say(Ack(0, first.seq))
    assert bench.state() is LineState.HANDSHAKE
    assert len(only(bench.answer(), Pattern)) == 1
    assert bench.state() is LineState.READY


def test_a_firing_pattern_that_cannot_be(bench: Bench) -> None:
    ring = CONFIG.ring.model_copy(update={"firing": FiringConfig(sets=((40,),))})
    with pytest.raises(FiringError):
        bench.robot.set_firing(ring)
    assert bench.heard() == []
    assert bench.state() is LineState.READY
