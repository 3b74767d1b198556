"""What simulators, other clients and real firmware are known to do, and how the driver meets it."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

import pytest

from drivers.arcos.codec import encode
from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.frames import Packet, RobotName, SipFlags, SonarReading, SyncEcho
from drivers.driver import LineState
from drivers.messages import Flags, Odometry, Twist
from tests.drivers.arcos.harness import OVER_TCP, P3DX_FILE, Controller, Harness, numbers
from tests.drivers.arcos.vectors import P3DX, TAIL

N = CommandNumber
ALL_DISCS = tuple(SonarReading(disc, 1000 + disc) for disc in range(16))


class Simulator(Controller):
    """As a known simulator: all discs in each SIP, no watchdog, motors on at first, and deaf to what it lacks."""

    def __init__(self) -> None:
        super().__init__()
        self.answers_encoder = False
        self.name = RobotName("AMRISim", "Pioneer", "p3dx")

    def next_sip(self) -> bytes:
        self.readings = ALL_DISCS
        return super().next_sip()

    def _answers(self, command: Command) -> tuple[Packet, ...]:
        if command.number in (N.HOSTBAUD, N.SONARCYCLE, N.POLLING):
            return ()
        answers = super()._answers(command)
        if self.session == "open" and command.number == N.OPEN:
            self.motors = True
        return answers


class Strict(Controller):
    """Begins its handshake again at any command out of order."""

    def __init__(self) -> None:
        super().__init__()
        self._expected = 0

    def _answers(self, command: Command) -> tuple[Packet, ...]:
        if self.session == "wait":
            is_next = command.number == self._expected
            self._expected = (self._expected + 1) % 3 if is_next else 0
            return super()._answers(command) if is_next else ()
        return super()._answers(command)


class Late(Controller):
    """Carries out velocities as late as it shows them: after three SIPs."""

    def __init__(self) -> None:
        super().__init__()
        self._velocities: deque[int] = deque([0, 0, 0])

    def next_sip(self) -> bytes:
        self.speed = self._velocities.popleft() if self.motors else 0
        self._velocities.append(self._velocities[-1] if self._velocities else 0)
        return super().next_sip()

    def _answers(self, command: Command) -> tuple[Packet, ...]:
        if command.number == N.VEL:
            self._velocities[-1] = command.value
            return ()
        if command.number in (N.STOP, N.ESTOP):
            self._velocities[-1] = 0
            return ()
        return super()._answers(command)


def odometry(harness: Harness) -> list[Odometry]:
    return [received.odometry for received in harness.received if received.odometry is not None]


def test_a_simulator_over_tcp_is_driven_and_seen() -> None:
    harness = Harness(OVER_TCP, Simulator())
    harness.ready()
    assert not harness.controller.motors, "the motors of its first session are on until they are switched off"
    harness.arm()
    harness.run(1.0, lambda: harness.driver.drive(Twist(0.2, 0.0)))
    assert odometry(harness)[-1].twist == Twist(0.2, 0.0), "its SIPs have the type of a robot at rest"
    newest = [firing for received in harness.received for firing in received.firings][-1]
    assert newest.robot_s == odometry(harness)[-1].robot_s
    assert not math.isnan(newest.ranges_m.sum())
    harness.driver.halt()
    harness.run(0.4)
    assert harness.flags == Flags.LATCHED


def test_a_serial_robot_that_ignores_hostbaud_keeps_its_speed() -> None:
    harness = Harness(controller=Simulator())
    harness.ready()
    assert harness.driver.line_baud == 9600
    assert any("did not follow to 38400 baud, and the line stays at 9600" in note for note in harness.notes)


def test_a_list_that_announces_ranges_it_does_not_hold_gives_none() -> None:
    harness = Harness()
    harness.ready()
    before = len(odometry(harness))
    harness.to_driver(encode(replace(TAIL, missing=16, flags=0x1E)))
    received = harness.driver.take_received()
    assert received.firings == ()
    assert received.odometry is not None
    harness.run(0.3)
    assert len(odometry(harness)) > before


def test_a_false_header_in_noise_does_not_hold_up_the_handshake() -> None:
    """The robot sends six bytes each time it is called: 250 would take ten seconds."""
    harness = Harness(OVER_TCP)
    harness.open()
    harness.to_driver(b"\xfa\xfb\xff")
    harness.run(1.5)
    assert harness.state() is LineState.READY


def test_discs_that_no_robot_has_are_skipped() -> None:
    harness = Harness()
    harness.ready()
    harness.controller.readings = tuple(SonarReading(disc, 1000) for disc in (16, 31, 32, 255))
    harness.run(0.3)
    assert all(received.firings == () for received in harness.received)


def test_a_robot_whose_watchdog_has_stopped_it_is_not_set_in_motion_by_the_first_command() -> None:
    """The next valid command of any number lets it accelerate to its last set-points, SYNC0 too."""
    harness = Harness()
    harness.ready()
    harness.arm()
    harness.run(0.3, lambda: harness.driver.drive(Twist(0.3, 0.0)))
    harness.driver.line_closed()
    harness.now += 5.0
    harness.controller.received.clear()
    harness.open()
    harness.run(0.5)
    assert harness.controller.received[:2] == [Command(N.STOP), Command(N.ESTOP)]


def test_a_velocity_that_takes_effect_after_the_halt_does_not_move_the_base() -> None:
    harness = Harness(controller=Late())
    harness.ready()
    harness.arm()
    harness.driver.drive(Twist(0.3, 0.0))
    harness.exchange()
    harness.driver.halt()
    harness.received.clear()
    harness.run(1.5)
    assert harness.flags == Flags.LATCHED
    assert not harness.controller.motors
    assert odometry(harness)[-1].twist == Twist(0.0, 0.0)


def test_a_stall_that_alternates_is_seen_each_time() -> None:
    harness = Harness()
    harness.ready()
    seen = []
    for stalled in (1, 0, 0, 0, 1, 0, 0, 1):
        harness.sip(stall_left=stalled, stall_right=stalled)
        harness.received.clear()
        harness.run(0.1)
        seen.append(any(Flags.MOTOR_FAULT in received.flags for received in harness.received))
    assert seen == [bool(stalled) for stalled in (1, 0, 0, 0, 1, 0, 0, 1)]


def test_slow_echoes_do_not_confuse_the_handshake() -> None:
    """A simulator echoes a SYNC after up to 0.2 s; a repeated one is echoed twice."""
    harness = Harness(OVER_TCP)
    harness.open()
    harness.run(0.28)
    harness.to_driver(encode(SyncEcho(0)) * 2)
    harness.run(2.0)
    assert harness.state() is LineState.READY


@pytest.mark.parametrize("is_halting", [False, True])
def test_nothing_comes_between_the_syncs(*, is_halting: bool) -> None:
    harness = Harness(controller=Strict())
    harness.open()
    harness.run(0.7, harness.driver.halt if is_halting else None)
    assert harness.state() is LineState.READY


@pytest.mark.parametrize("period_s", [0.05, 0.1])
def test_sips_may_come_twice_as_often_as_announced(period_s: float) -> None:
    harness = Harness()
    harness.ready()
    start_s = odometry(harness)[-1].robot_s
    for _ in range(round(2.0 / period_s)):
        harness.now += period_s
        harness.to_driver(harness.controller.next_sip())
        harness.driver.tick(harness.now)
    newest = harness.driver.take_received().odometry
    assert newest is not None
    assert newest.robot_s - start_s == pytest.approx(2.0, abs=0.11)


@pytest.mark.parametrize("kind", [0x30, 0x31, 0x33, 0x34])
def test_sips_of_other_types_count(kind: int) -> None:
    harness = Harness()
    harness.sip(kind=kind)
    harness.ready()
    assert odometry(harness)


def test_a_sip_of_old_firmware_without_a_tail_counts() -> None:
    harness = Harness()
    harness.controller.sip = replace(
        TAIL,
        battery_10=None,
        charge=None,
        turn_10=None,
        fault_flags=None,
        lateral=None,
        temperature=None,
        charge_percent=None,
    )
    harness.ready()
    assert harness.flags == Flags.LATCHED


def test_an_odometry_that_another_client_sets_to_zero_does_not_move_the_robot() -> None:
    harness = Harness()
    harness.sip(x=2000, y=-300, heading=700)
    harness.ready()
    harness.run(2.0)
    before = odometry(harness)[-1].pose
    harness.sip(x=0, y=0, heading=0)
    harness.run(1.0)
    after = odometry(harness)[-1].pose
    assert (after.x, after.y, after.theta) == pytest.approx((before.x, before.y, before.theta))
    assert any("the odometry jumped" in note for note in harness.notes)


def test_a_robot_that_repeats_its_name_or_configuration_goes_on() -> None:
    harness = Harness()
    harness.ready()
    harness.to_driver(encode(RobotName("other", "Pioneer", "p3at")) + encode(P3DX) + encode(SyncEcho(0)))
    harness.run(0.5)
    assert harness.state() is LineState.READY
    assert harness.driver.identity is not None
    assert harness.driver.identity.name == "box"


def test_a_line_at_9600_baud_carries_what_the_driver_sends() -> None:
    """960 bytes a second: velocities at 20 Hz, requests and a pulse are well below."""
    robot = P3DX_FILE.model_copy(update={"link": P3DX_FILE.link.model_copy(update={"baud": 9600})})
    harness = Harness(robot)
    harness.ready()
    assert N.HOSTBAUD not in numbers(harness.controller.received)
    harness.arm()
    sent = []
    for _ in range(100):
        harness.driver.drive(Twist(0.2, 0.1))
        sent += harness.run(0.05)
    assert sum(len(encode(command)) for command in sent) / 5.0 < 480.0


def test_the_stop_button_with_its_line_engaged_is_a_latch() -> None:
    harness = Harness()
    harness.ready()
    harness.arm()
    harness.controller.flags = SipFlags.E_STALL
    harness.run(0.2)
    assert Flags.LATCHED in harness.flags


def test_a_robot_with_none_of_the_files_sonars_is_named_once() -> None:
    """Its ranges were dropped, and the ring's power and cable blamed."""
    harness = Harness()
    harness.ready()

    def report(*discs: int) -> tuple[str | None, int]:
        for disc in discs:
            harness.controller.readings = (SonarReading(disc, 1000),)
            harness.run(0.1)
        return harness.driver.problem, sum("none of those that" in note for note in harness.notes)

    assert report(16, 17, 18, 3, 16, 17, 18, 19) == (None, 0), "a few are of a sequence before the file's"
    said, notes = report(20, 21)
    assert "file lists, 0, 1, 2, 3," in (said or "")
    assert notes == 1
    assert report(3) == (None, 1)
    assert report(*range(16, 26))[1] == 1
