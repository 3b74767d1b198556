"""What the contract leaves open: gaps, sonars that stop, a fail-safe, a driver that is held up, the end of a run."""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest

from config.load import load_robot
from drivers.contract.family import PLAIN
from drivers.driver import LineState
from drivers.messages import Flags, Twist
from drivers.registry import make_driver
from drivers.rflex import diagnostics
from drivers.rflex.codec import (
    BRAKE_SET,
    STATUS_REQUEST,
    Decoder,
    Frame,
    Input,
    encode,
    frame_of,
    input_request,
    report_request,
    sonar_run,
)
from drivers.rflex.wire_units import drive_commands
from drivers.session import Session
from tests.drivers.contract.families import RFLEX
from tests.drivers.device_host import script


def test_commands_have_gaps_and_are_sent_one_at_a_time() -> None:
    cable = RFLEX.cable()
    decoder, times = Decoder(), list[float]()
    receive = cable.robot.receive

    def counting(data: bytes) -> None:
        frames = decoder.feed(data)
        assert len(frames) <= 1
        times.extend([cable.now_s] * len(frames))
        receive(data)

    cable.robot.receive = counting  # type: ignore[method-assign]
    cable.plug()
    cable.run(1.0)
    assert len(times) > 10
    assert min(b - a for a, b in itertools.pairwise(times)) >= 0.0099


def test_a_driver_that_is_asked_once_a_cycle_sends_both_axes_and_asks_for_the_status() -> None:
    cable = RFLEX.driving()
    driver, decoder, sent = cable.driver, Decoder(), list[Frame]()
    for cycle in range(40):
        now_s = cable.now_s + 0.05 * (cycle + 1)
        driver.receive(cable.robot.advance(now_s), now_s)
        driver.tick(now_s)
        driver.drive(Twist(0.1, 0.08))
        data = driver.outgoing(writable=True)
        cable.robot.receive(data)
        sent += decoder.feed(data)
    assert driver.state is LineState.READY
    assert (cable.robot.truth.twist.v, cable.robot.truth.twist.w) == pytest.approx((0.1, 0.08), abs=0.002)
    assert sent.count(STATUS_REQUEST) >= 6


def test_only_a_velocity_is_sent_without_a_gap() -> None:
    """The controller would lose a status request or a sonar command that comes too soon; a velocity is repeated."""
    cable = RFLEX.driving()
    driver, decoder, sent = cable.driver, Decoder(), list[tuple[float, Frame]]()
    for cycle in range(200):
        for later_s in (0.0, 0.01):
            now_s = cable.now_s + 0.015 * (cycle + 1) + later_s
            driver.receive(cable.robot.advance(now_s), now_s)
            driver.tick(now_s)
            if later_s == 0.0:
                driver.drive(Twist(0.1, 0.08))
            data = driver.outgoing(writable=True)
            cable.robot.receive(data)
            sent += [(now_s, frame) for frame in decoder.feed(data)]
    velocities = drive_commands(Twist(0.1, 0.08), RFLEX.robot)
    gaps = [b_s - a_s for (a_s, _), (b_s, frame) in itertools.pairwise(sent) if frame not in velocities]
    assert len(gaps) >= 10
    assert min(gaps) >= 0.0099


def test_sonars_that_stop_are_started_again() -> None:
    cable = RFLEX.connected()
    cable.robot.receive(encode(sonar_run(0, 0, on=False)))
    cable.run(0.3)
    cable.firings.clear()
    cable.until_echo(1.0)
    assert diagnostics.NO_SONAR in cable.notes


def test_the_fail_safe_is_what_the_robot_file_says_and_must_suit() -> None:
    cable = RFLEX.connected()
    assert diagnostics.fail_safe(1.0) in cable.notes
    slow = RFLEX.robot.model_copy(update={"rflex": RFLEX.robot.rflex.model_copy(update={"fail_safe_s": 5.0})})
    driver = make_driver(slow)
    assert isinstance(driver, Session)
    cable.driver = driver
    cable.plug()
    cable.run(0.5)
    assert (driver.state, driver.is_other_robot) == (LineState.DOWN, True)
    assert "5 s" in (driver.problem or "")


def test_a_base_that_gets_no_velocity_is_stopped_by_the_driver_too() -> None:
    cable = RFLEX.driving()
    cable.twist = None
    cable.until(lambda: diagnostics.NOT_DRIVEN in cable.notes, 0.6, "note")
    cable.run(0.7)
    assert abs(cable.robot.truth.twist.v) < 1e-4


def test_a_brake_that_stays_on_is_a_problem() -> None:
    cable = RFLEX.connected(world=PLAIN)
    cable.robot._obey = lambda _: None  # type: ignore[attr-defined]
    cable.driver.release()
    cable.run(0.5)
    assert cable.driver.problem == diagnostics.BRAKE_STAYS_ON


def test_a_line_of_seven_bits_is_down_although_each_checksum_is_right() -> None:
    cable = RFLEX.connected(world=PLAIN)
    cable.unplug()
    cable.split = lambda data: [bytes(byte & 0x7F for byte in data)]
    cable.plug()
    states = set[LineState]()
    for _ in range(200):
        cable.run(0.01)
        states.add(cable.driver.state)
    assert states == {LineState.HANDSHAKE, LineState.DOWN}, "it cannot be armed while its bits are counted"
    assert cable.driver.counts.bad == 0
    assert cable.driver.problem == diagnostics.SEVEN_BITS
    cable.unplug()
    cable.split = lambda data: [data]
    cable.plug()
    cable.until_state(LineState.READY, 2.0)
    cable.run(1.0)
    assert cable.driver.problem is None


def test_a_lost_request_for_the_bumpers_is_made_good() -> None:
    cable = RFLEX.connected(*script(kind="bumper", at_s=4.0, duration_s=1.0))
    cable.robot.receive(encode(input_request(0)))
    cable.run(4.2 - cable.now_s)
    assert cable.flags & Flags.BUMPER


def test_only_the_bits_of_bumper_panels_are_contacts() -> None:
    cable = RFLEX.connected()
    for report in (Input(0, 0x31, 0xFF), Input(0, 0x42, 0xF0)):
        cable.driver.receive(encode(frame_of(report)), cable.now_s)
    cable.run(0.1)
    assert not cable.flags & Flags.BUMPER
    cable.driver.receive(encode(frame_of(Input(0, 0x42, 0x05))), cable.now_s)
    cable.run(0.1)
    assert cable.flags & Flags.BUMPER


def test_the_end_of_a_session_brakes_and_ends_all_reports() -> None:
    cable = RFLEX.driving(Twist(0.2, 0.0))
    cable.driver.end_session()
    frames = Decoder().feed(cable.driver.outgoing(writable=True))
    assert frames[2:] == [BRAKE_SET, sonar_run(0, 0, on=False), input_request(0), report_request(0, 0)]
    assert cable.driver.state is LineState.CLOSED
    assert cable.driver.outgoing(writable=True) == b""


def test_a_synchro_ring_keeps_its_direction() -> None:
    family = replace(RFLEX, robot=load_robot("b21r-base"))
    cable = family.driving(Twist(0.2, 0.5))
    cable.run(1.0)
    assert cable.odometry[-1].pose.theta > 0.4
    assert cable.odometry[-1].ring_yaw == cable.robot.truth.ring_yaw == 0.0
    assert diagnostics.SYNCHRO in cable.notes
