"""The conversation with a Denning in virtual time: greeting, firing pattern, who it is, and what is counted."""

from __future__ import annotations

from dataclasses import replace

import pytest

from config.robot import FiringConfig
from drivers.denning.codec import Decoder, encode
from drivers.denning.frames import (
    Ack,
    Echo,
    Hello,
    Ident,
    Nak,
    NakCode,
    Pattern,
)
from drivers.driver import LineState
from drivers.firing_pattern import FiringError
from drivers.messages import LinkCounts, Twist
from tests.drivers.driver_harness import CONFIG, IDENT, ODOM, PERIOD_US, DriverHarness, only
from tests.drivers.vectors import OCTETS


def test_hello_then_pattern_then_ready() -> None:
    harness = DriverHarness()
    harness.open()
    assert harness.state() is LineState.HANDSHAKE
    first = harness.robot.outgoing(writable=True)
    assert first[0] == 0, "a zero ends what an earlier user left half said"
    assert Decoder("host").feed(first) == [Hello(0, 2)]
    assert harness.received() == []
    harness.send(IDENT)
    assert harness.state() is LineState.HANDSHAKE
    assert harness.received() == [Pattern(1, 50, 255, OCTETS)]
    harness.send(Ack(0, 1))
    assert harness.state() is LineState.READY
    assert harness.robot.problem is None
    identity = harness.robot.identity
    assert identity is not None
    assert (identity.name, identity.sensors, identity.boot_id) == ("denning", 24, 0xB001)
    assert (identity.ring_radius_m, identity.deadman_s, identity.odometry_period_s) == pytest.approx(
        (0.381, 0.5, 0.02)
    )
    assert harness.robot.counts == LinkCounts(frames=2)
    assert not harness.robot.take_received().rebooted


def test_data_before_the_end_of_the_handshake_is_ignored() -> None:
    harness = DriverHarness()
    harness.open()
    harness.odom(1_000_000)
    assert harness.robot.take_received().odometry is None, "whose odometry?"
    harness.received()
    harness.send(IDENT)
    harness.odom(1_020_000)
    harness.send(Echo(0, 1_020_000, 0, 1, (10,)))
    harness.handshake()
    harness.odom(1_040_000)
    heard = harness.robot.take_received()
    assert heard.odometry is not None
    assert heard.firings == (), "a firing of an earlier pattern"


def test_an_unanswered_command_is_sent_three_times_each_with_its_own_number() -> None:
    harness = DriverHarness()
    harness.open()
    sent = []
    for _ in range(31):
        sent += harness.received()
        harness.pass_time(0.01)
    assert sent == [Hello(0, 2), Hello(1, 2), Hello(2, 2)]
    assert harness.device_lost == 0
    assert harness.state() is LineState.DOWN
    assert "no answer to 3 HELLO commands and nothing is received" in (harness.robot.problem or "")


def test_an_ack_of_any_try_counts() -> None:
    harness = DriverHarness()
    harness.open()
    harness.answer()
    (pattern,) = harness.received()
    harness.pass_time(0.11)
    (again,) = harness.received()
    assert isinstance(again, Pattern)
    assert again.masks == OCTETS
    assert again.seq != pattern.seq
    harness.send(Ack(0, pattern.seq))
    assert harness.state() is LineState.READY
    harness.send(Ack(0, again.seq))
    assert harness.state() is LineState.READY
    assert harness.robot.problem is None


def test_a_silent_robot_is_sent_hello_twice_a_second_until_it_answers() -> None:
    harness = DriverHarness()
    harness.open()
    hellos = 0
    for _ in range(1000):
        hellos += len(only(harness.received(), Hello))
        harness.pass_time(0.01)
    assert harness.state() is LineState.DOWN
    assert 15 <= hellos <= 30
    while not only(heard := harness.received(), Hello):
        harness.pass_time(0.01)
    assert len(heard) == 1
    harness.send(IDENT)
    assert harness.state() is LineState.HANDSHAKE
    assert harness.robot.problem is not None, "still says why it took so long"
    harness.answer()
    assert harness.state() is LineState.READY
    assert harness.robot.problem is None


@pytest.mark.parametrize(
    ("ident", "text"),
    [
        (replace(IDENT, version=3), "speaks version 3"),
        (replace(IDENT, sensors=16), "has 16 sensors and the robot file 24"),
        (replace(IDENT, ring_radius_mm=383), r"a radius of 0\.383 m and the robot file says 0\.381 m"),
    ],
)
def test_another_robot_than_expected_is_not_driven(ident: Ident, text: str) -> None:
    harness = DriverHarness()
    harness.ident = ident
    harness.open()
    harness.answer()
    assert harness.state() is LineState.DOWN
    assert harness.robot.is_other_robot
    with pytest.raises(AssertionError, match=text):
        raise AssertionError(harness.robot.problem)
    harness.robot.drive(Twist(0.1, 0.0))
    assert harness.received() == []
    harness.ident = replace(IDENT, ring_radius_mm=382)
    harness.pass_time(0.6)
    harness.handshake()


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (NakCode.VALUE_OUT_OF_RANGE, "NAK 3.*: a value is out of its range; make ring.firing.step_period_s longer"),
        (NakCode.UNKNOWN_TYPE, "NAK 1.* does not know this command; check .* same version"),
        (99, "NAK 99.* a reason this program does not know"),
    ],
)
def test_a_refused_pattern_takes_the_link_down(code: int, text: str) -> None:
    harness = DriverHarness()
    harness.open()
    harness.answer()
    (pattern,) = harness.received()
    harness.send(Nak(0, pattern.seq, code))
    assert (harness.state(), harness.robot.is_other_robot) == (LineState.DOWN, True)
    with pytest.raises(AssertionError, match=text):
        raise AssertionError(harness.robot.problem)


def test_frame_counts_continue_on_the_next_line(harness: DriverHarness) -> None:
    harness.send(ODOM)
    harness.robot.receive(b"\x01\x02\x03\0", harness.now)
    harness.robot.receive(encode(replace(ODOM, seq=6)), harness.now)
    assert harness.robot.counts == LinkCounts(frames=4, bad=1, lost=3)
    harness.robot.line_closed()
    harness.robot.receive(encode(ODOM), harness.now)
    harness.open()
    harness.handshake()
    assert harness.robot.counts == LinkCounts(frames=6, bad=1, lost=3)


def test_noise_instead_of_an_answer_points_at_the_baud_rate() -> None:
    harness = DriverHarness()
    harness.open()
    for _ in range(40):
        harness.received()
        harness.robot.receive(b"\x9f\x33\0", harness.now)
        harness.pass_time(0.01)
    assert "or the line has another speed: check the port and link.baud" in (harness.robot.problem or "")


@pytest.mark.parametrize(
    ("broken", "message"), [(1, "nothing received for 0.41 s"), (9, "9 corrupt frames came in place of it; noise")]
)
def test_noise_in_place_of_odometry_is_named_and_one_broken_frame_is_not(
    harness: DriverHarness, broken: int, message: str
) -> None:
    harness.robot.receive(b"\x9f\x33\0" * broken, harness.now)
    harness.pass_time(0.41)
    assert harness.state() is LineState.DOWN
    assert message in (harness.robot.problem or "")


def test_noise_in_place_of_echoes_is_named_once_they_are_overdue(harness: DriverHarness) -> None:
    for k in range(30):
        harness.odom(k * PERIOD_US)
        harness.robot.receive(b"\x9f\x33\0" * (k % 2), harness.now)
        harness.pass_time(0.02)
        assert harness.robot.problem is None or k > 20
    assert "corrupt frames came in place of its echoes; noise" in (harness.robot.problem or "")
    harness.send(Echo(0, 29 * PERIOD_US, 0, 1, (10,)))
    assert harness.robot.problem is None


def test_another_firing_pattern_while_it_drives(harness: DriverHarness) -> None:
    ring = CONFIG.ring.model_copy(update={"firing": FiringConfig(preset="quadrants", step_period_s=0.06)})
    harness.robot.set_firing(CONFIG.ring)
    assert harness.received() == [], "the one under way is not said again"
    harness.robot.set_firing(ring)
    (pattern,) = only(harness.answer(), Pattern)
    assert isinstance(pattern, Pattern)
    assert (len(pattern.masks), pattern.step_period_ms) == (6, 60)
    assert harness.state() is LineState.READY
    harness.robot.line_closed()
    harness.open()
    (again,) = only([*harness.answer(), *harness.answer()], Pattern)
    assert replace(again, seq=pattern.seq) == pattern, "kept for the next line"


def test_a_ring_that_was_slowed_down_is_waited_for(harness: DriverHarness) -> None:
    """Its echoes come once a second: that is no silence after which the robot must identify itself."""
    ring = CONFIG.ring.model_copy(update={"firing": FiringConfig(preset="quadrants", step_period_s=1.0)})
    harness.robot.set_firing(ring)
    harness.answer()
    asked = []
    for k in range(100):
        harness.odom(k * PERIOD_US)
        harness.pass_time(0.02)
        asked += only(harness.received(), Hello)
    assert asked == []


def test_another_firing_pattern_before_the_first_is_taken() -> None:
    """An answer to the first must not pass for one to the second."""
    harness = DriverHarness()
    harness.open()
    harness.answer()
    (first,) = only(harness.received(), Pattern)
    ring = CONFIG.ring.model_copy(update={"firing": FiringConfig(preset="quadrants", step_period_s=0.06)})
    harness.robot.set_firing(ring)
    harness.send(Ack(0, first.seq))
    assert harness.state() is LineState.HANDSHAKE
    assert len(only(harness.answer(), Pattern)) == 1
    assert harness.state() is LineState.READY


def test_an_infeasible_firing_pattern_is_refused_and_the_current_one_stays(harness: DriverHarness) -> None:
    ring = CONFIG.ring.model_copy(update={"firing": FiringConfig(sets=((40,),))})
    with pytest.raises(FiringError):
        harness.robot.set_firing(ring)
    assert harness.received() == []
    assert harness.state() is LineState.READY
