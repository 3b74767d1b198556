"""The emulated Pioneer's flash: its CONFIGpac, and the codes of line speeds."""

from __future__ import annotations

from dataclasses import fields, replace

import pytest

from drivers.arcos.codec import decode_packet, encode
from drivers.arcos.firmware import RampSettings, baud_code
from drivers.arcos.frames import ConfigPacket
from tests.drivers.arcos.device_host import P3DX

RAMPS = RampSettings(300, 400, 100, 120)


def test_the_configuration_packet_is_whole_up_to_the_last_field_of_older_firmware() -> None:
    packet = P3DX.config_packet(750, 100, 2000, RAMPS)
    read = decode_packet(encode(packet)[3:-2])
    assert read == packet
    names = [field.name for field in fields(ConfigPacket)]
    missing = [name for name in names if getattr(packet, name) is None]
    assert missing[0] == "pdb_port"
    assert (packet.deceleration, packet.turn_acceleration, packet.turn_max) == (400, 100, 100)


def test_a_robot_without_discs_behind_has_no_rear_sonar() -> None:
    packet = replace(P3DX, sensor_numbers=tuple(range(8)), subclass="p3at").config_packet(750, 100, 2000, RAMPS)
    assert (packet.front_sonar, packet.rear_sonar, packet.four_motors) == (1, 0, 1)


@pytest.mark.parametrize(("baud", "code"), [(9600, 0), (38400, 2), (115200, 4), (4800, 0)])
def test_a_line_speed_has_a_code(baud: int, code: int) -> None:
    assert baud_code(baud) == code
