"""What a Pioneer's packets take on the line."""

from __future__ import annotations

from dataclasses import replace

from drivers.arcos.codec import encode
from drivers.arcos.frames import Sip, SonarReading
from drivers.arcos.line_load import RANGE_BYTES, SIP_BYTES


def test_the_sizes_of_a_pioneers_packets_are_those_on_the_line() -> None:
    still = Sip(
        0x32, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, gripper=0, analog_port=0, analog=0, digital_in=0, digital_out=0,
        battery_10=0, charge=0, turn_10=0, fault_flags=0, lateral=0, temperature=0, charge_percent=0, controller_us=0,
        flags_3=0,
    )  # fmt: skip
    assert len(encode(still)) == SIP_BYTES
    assert len(encode(replace(still, sonar=(SonarReading(0, 0),)))) == SIP_BYTES + RANGE_BYTES
