"""The emulated Pioneer keeps the protocol: synchronising, SIPs, motors, watchdog, closing, resets."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.robot import BodyConfig
from config.world import WorldConfig
from drivers.arcos.codec import encode, frame
from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.device import ArcosDevice
from drivers.arcos.frames import (
    ConfigPacket,
    ResetNotice,
    RobotName,
    Sip,
    SyncEcho,
)
from drivers.driver import DriverError
from drivers.messages import Flags, Twist
from tests.drivers.arcos.device_host import P3DX, ROBOT, SYNC, WATCHDOG_S, Client
from tests.drivers.device_host import script

STILL = Twist(0.0, 0.0)
ENABLE, VEL, RVEL = CommandNumber.ENABLE, CommandNumber.VEL, CommandNumber.RVEL

# The session.


def test_a_client_synchronises_and_opens() -> None:
    client = Client()
    for command in SYNC:
        client.robot.receive(encode(command))
        client.run(0.02)
    assert bytes(client.raw[:12]).hex() == "fafb03000000fafb03010001"
    assert client.of(SyncEcho) == [SyncEcho(0), SyncEcho(1)]
    assert client.of(RobotName) == [RobotName("echolocate", "Pioneer", "p3dx")]
    client.run(1.0)
    assert len(client.heard) == 3, "nothing before OPEN"
    client.send(CommandNumber.OPEN, 1)
    client.run(1.05)
    assert len(client.of(Sip)) == 10
    assert {sip.flags & 1 for sip in client.of(Sip)} == {0}, "motors off"
    assert client.sip().flags & 0x1E == 0x1E, "sonar on"


@pytest.mark.parametrize("noise", [b"WMS2\r", b"\xfa", b"\xfa\xfb\x03\x00\x00\x01", b"\xfa\xfb\xff" + bytes(40)])
def test_what_comes_before_does_not_matter(noise: bytes) -> None:
    client = Client()
    client.robot.receive(noise)
    for _ in range(50):
        client.robot.receive(encode(SYNC[0]))
        client.run(0.02)
    assert client.of(SyncEcho)


def test_a_client_that_was_cut_off_within_a_header_does_not_swallow_the_next_one_s_packets() -> None:
    client = Client()
    client.robot.receive(b"\xfa\xfb")
    client.robot.receive(encode(SYNC[0]))
    client.run(0.25)
    assert client.heard == [], "250 bytes are announced"
    client.robot.receive(encode(SYNC[0]))
    client.run(0.05)
    assert client.of(SyncEcho)


def test_waiting_it_ignores_commands_and_an_open_or_close_with_an_argument() -> None:
    client = Client()
    for command in (Command(ENABLE, 1), Command(VEL, 200), Command(1, 1), Command(2, 1), Command(18, 1)):
        client.robot.receive(encode(command))
    client.run(0.5)
    assert client.heard == []


def test_in_the_middle_of_synchronising_a_client_may_begin_again() -> None:
    client = Client()
    for command in (*SYNC, SYNC[2], SYNC[0], *SYNC, Command(1)):
        client.robot.receive(encode(command))
        client.run(0.02)
    assert [type(packet).__name__ for packet in (p for _, p in client.heard)][:7] == [
        "SyncEcho", "SyncEcho", "RobotName", "RobotName", "SyncEcho", "SyncEcho", "SyncEcho",
    ]  # fmt: skip
    client.run(0.2)
    assert client.of(Sip)


def test_a_close_before_any_sync_is_not_answered_as_its_bytes_would_be_later() -> None:
    client = Client()
    client.robot.receive(encode(Command(CommandNumber.CLOSE)))
    client.run(0.5)
    assert client.heard == []
    for command in SYNC[1:]:
        client.robot.receive(encode(command))
        client.run(0.02)
    assert [type(packet) for _, packet in client.heard] == [SyncEcho, RobotName], "as a simulator does it"


def test_close_stops_the_base_and_the_sips_and_it_can_be_opened_again() -> None:
    client = Client().opened(motors=True)
    client.send(VEL, 300)
    client.run(1.0)
    client.send(CommandNumber.CLOSE, 1)
    count = len(client.heard)
    client.run(1.0)
    assert client.twist == STILL
    assert len(client.heard) == count
    client.opened()
    client.run(0.3)
    assert (client.sip().x, client.sip().flags & 1) == (0, 0), "odometry from zero, motors off"


@pytest.mark.parametrize(("number", "kind"), [(CommandNumber.RESET, 0xFF), (CommandNumber.MAINTENANCE, 0xFE)])
def test_a_reset_is_announced_and_ends_the_session(number: int, kind: int) -> None:
    client = Client().opened(motors=True)
    client.send(VEL, 300)
    client.run(1.0)
    client.send(number)
    client.run(0.5)
    assert client.heard[-1][1] == ResetNotice(kind)
    assert client.twist == STILL
    client.opened()
    before = len(client.of(Sip))
    client.run(0.2)
    assert len(client.of(Sip)) > before


def test_a_synchro_drive_is_not_of_this_family() -> None:
    body = BodyConfig(radius_m=0.25, speed_max_m_s=1.0, turn_max_rad_s=1.0, synchro=True)
    with pytest.raises(DriverError, match=r"set body\.synchro = false"):
        ArcosDevice(ROBOT.model_copy(update={"body": body}), WorldConfig(), P3DX, 1)


# The watchdog.


def test_without_a_command_the_base_stops_and_the_next_one_revives_the_set_point() -> None:
    client = Client().opened(motors=True)
    client.send(VEL, 300)
    client.run(WATCHDOG_S - 0.01)
    assert client.twist.v == pytest.approx(0.3)
    assert not client.robot.flags & Flags.DEADMAN
    client.run(0.02)
    assert client.robot.flags & Flags.DEADMAN
    client.run(1.01)
    assert client.twist == STILL
    count = len(client.of(Sip))
    client.run(1.0)
    assert len(client.of(Sip)) == count + 10, "SIPs go on"
    client.send(CommandNumber.PULSE)
    client.run(1.1)
    assert client.twist.v == pytest.approx(0.3)


def test_a_frame_with_a_wrong_checksum_does_not_feed_the_watchdog() -> None:
    client = Client().opened(motors=True)
    client.send(VEL, 300)
    for _ in range(25):
        client.run(0.1)
        client.robot.receive(bytes.fromhex("fafb03000001"))
    assert client.robot.flags & Flags.DEADMAN


# Faults.


def test_a_runaway_drives_until_the_motors_are_off() -> None:
    client = Client(faults=script(kind="runaway", at_s=0.5, duration_s=9.0, v_m_s=0.2)).opened(motors=True)
    client.run(2.0, pulse_s=0.5)
    client.send(CommandNumber.STOP)
    client.run(0.5)
    assert client.twist.v == pytest.approx(0.2)
    client.send(ENABLE, 0)
    client.run(0.2)
    assert client.twist == STILL


def test_an_ignored_halt_is_reported_as_obeyed_and_the_base_drives_on() -> None:
    client = Client(faults=script(kind="ignored_halt", at_s=0.5, duration_s=5.0)).opened(motors=True)
    client.send(VEL, 300)
    client.run(1.5)
    for number, value in ((CommandNumber.STOP, None), (CommandNumber.ESTOP, None), (ENABLE, 0)):
        client.send(number, value)
    client.run(3.0)
    assert client.twist.v == pytest.approx(0.3)
    assert client.sip().flags & 1 == 0
    client.run(2.0)
    assert client.twist == STILL, "when it is over, the motors are off"


def test_a_motor_fault_switches_the_motors_off_and_they_stay_off_while_it_lasts() -> None:
    client = Client(faults=script(kind="motor_fault", at_s=1.0, duration_s=1.0)).opened(motors=True)
    client.send(VEL, 300)
    client.run(1.5)
    client.send(ENABLE, 1)
    client.send(VEL, 300)
    client.run(0.3)
    assert client.twist == STILL
    assert (client.sip().flags & 1, client.sip().stall_left, client.sip().stall_right) == (0, 1, 1)
    client.run(0.5)
    client.send(ENABLE, 1)
    client.send(VEL, 300)
    client.run(0.5)
    assert client.twist.v > 0.1


def test_blocked_wheels_do_not_turn_and_report_nothing() -> None:
    client = Client(faults=script(kind="blocked_wheels", at_s=0.5, duration_s=1.0)).opened(motors=True)
    client.send(VEL, 300)
    client.run(1.4)
    assert (client.twist, client.sip().stall_left, client.sip().flags & 1) == (STILL, 0, 1)


def test_a_robot_that_restarts_says_so_once_it_is_back() -> None:
    client = Client(faults=script(kind="reboot", at_s=1.0, duration_s=0.5)).opened(motors=True)
    client.send(VEL, 300)
    client.run(1.4)
    assert client.twist == STILL
    client.run(0.5)
    assert isinstance(client.heard[-1][1], ResetNotice)
    assert client.heard[-1][0] == pytest.approx(1.5, abs=0.01)


def test_a_changed_watchdog_is_reported_and_kept() -> None:
    client = Client(faults=script(kind="deadman", at_s=0.0, deadman_ms=500)).opened(motors=True)
    client.send(VEL, 300)
    client.send(CommandNumber.CONFIG)
    client.run(0.6)
    assert client.of(ConfigPacket)[-1].watchdog_ms == 500
    assert client.robot.flags & Flags.DEADMAN


@pytest.mark.parametrize(("range_m", "raws"), [(None, set()), (1.0, {1000}), (99.0, {5000})])
def test_a_stuck_sensor_reports_its_one_range_or_none(range_m: float | None, raws: set[int]) -> None:
    fault = {"kind": "stuck_sensor", "at_s": 0.0, "duration_s": 9.0, "sensor": 3}
    client = Client(faults=script(**fault | ({} if range_m is None else {"range_m": range_m}))).opened()
    client.run(1.0)
    assert {reading.range_raw for sip in client.of(Sip) for reading in sip.sonar if reading.number == 3} == raws


def test_an_unplugged_robot_hears_nothing_and_its_watchdog_stops_it() -> None:
    client = Client(faults=script(kind="unplug", at_s=1.0, duration_s=3.0)).opened(motors=True)
    client.send(VEL, 300)
    client.run(1.5)
    client.send(CommandNumber.PULSE)
    assert not client.robot.plugged
    client.run(1.8)
    assert client.twist == STILL
    assert client.heard[-1][0] < 1.01


# Time, noise and drift.


@settings(max_examples=60, deadline=None)
@given(body=st.binary(min_size=1, max_size=30), opened=st.booleans())
def test_it_survives_any_command(body: bytes, opened: bool) -> None:
    client = Client()
    if opened:
        client.opened(motors=True)
    client.robot.receive(frame(body) + b"\xfa\xfb\x05" + body)
    client.run(0.3, step=0.1)
    assert client.decoder.bad == 0
