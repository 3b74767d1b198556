"""What clients of an emulated Pioneer ask for besides its SIPs, and what the SIPs show of it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.arcos.commands import CommandNumber
from drivers.arcos.frames import (
    ConfigPacket,
    EncoderPacket,
    IoPacket,
    JoystickPacket,
)
from drivers.messages import Flags
from tests.drivers.arcos.device_host import P3DX, Client

ENABLE, VEL, RVEL = CommandNumber.ENABLE, CommandNumber.VEL, CommandNumber.RVEL


def test_the_configuration_is_what_aria_reads() -> None:
    client = Client().opened()
    client.send(CommandNumber.CONFIG, 1)
    client.run(0.05)
    (config,) = client.of(ConfigPacket)
    assert (config.class_name, config.subclass, config.name) == ("Pioneer", "p3dx", "echolocate")
    assert (config.sip_cycle_ms, config.watchdog_ms, config.sonar_cycle_ms) == (100, 2000, 40)
    assert (config.auto_baud, config.front_sonar, config.rear_sonar) == (2, 1, 1)
    assert config.serial != "SIM", "ARIA would look for a simulated laser"
    assert config.charge_threshold == 0, "no field is missing"


def test_encoders_inputs_and_joystick_come_once_or_with_every_sip() -> None:
    client = Client().opened(motors=True)
    client.send(CommandNumber.ENCODER, 1)
    client.send(CommandNumber.IOREQUEST, 2)
    client.send(CommandNumber.JOYINFO, 2)
    client.send(VEL, 200)
    client.run(1.0)
    assert (len(client.of(EncoderPacket)), len(client.of(IoPacket)), len(client.of(JoystickPacket))) == (1, 10, 10)
    client.send(CommandNumber.IOREQUEST, 0)
    client.send(CommandNumber.ENCODER, 2)
    client.run(0.5)
    assert len(client.of(IoPacket)) == 10
    left = [packet.left for packet in client.of(EncoderPacket)]
    assert len(left) == 6
    assert left[-1] - left[-2] == pytest.approx(138 * 20, abs=138)


def test_outputs_analog_port_and_battery_show_in_the_sip() -> None:
    client = Client().opened()
    client.send(CommandNumber.DIGOUT, 0x0F05)
    client.send(CommandNumber.ADSEL, 3)
    client.send(CommandNumber.BATTEST, 105)
    client.run(0.2)
    sip = client.sip()
    assert (sip.digital_out, sip.analog_port, sip.battery, sip.battery_10) == (5, 3, 105, 105)
    assert client.robot.flags & Flags.BATTERY_LOW


def test_the_line_changes_its_speed_at_once_and_back_with_close() -> None:
    slow = Client(firmware=replace(P3DX, baud=9600)).opened()

    def bytes_in(seconds: float) -> int:
        before = len(slow.raw)
        for _ in range(10):
            slow.send(CommandNumber.CONFIG)
        slow.run(seconds)
        return len(slow.raw) - before

    assert bytes_in(0.5) <= 481
    slow.send(CommandNumber.HOSTBAUD, 2)
    assert 900 < bytes_in(0.5) <= 1921
    slow.send(CommandNumber.CLOSE)
    slow.run(1.0)
    slow.opened()
    assert bytes_in(0.5) <= 481
