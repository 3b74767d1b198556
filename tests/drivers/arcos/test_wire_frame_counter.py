"""Counting of SIPs with ranges and of velocities, in bytes split anywhere."""

from __future__ import annotations

from drivers.arcos.codec import encode
from drivers.arcos.commands import Command
from drivers.arcos.frames import Sip, SonarReading, SyncEcho
from drivers.arcos.wire_frame_counter import WireFrameCounter

STATUS = (0x32, 0, 0, 0, 0, 0, 126, 0, 0, 0, 0x1E, 0)


def test_ranges_and_velocities_are_counted() -> None:
    counter = WireFrameCounter()
    packets = (SyncEcho(0), Sip(*STATUS), Sip(*STATUS, sonar=(SonarReading(3, 1000),)))
    sent = b"".join(encode(packet) for packet in packets)
    assert sum(counter.echoes(sent[k : k + 1]) for k in range(len(sent))) == 1
    received = b"".join(encode(Command(*command)) for command in ((0,), (11, 200), (21, 3), (32, 0x0A0A)))
    assert sum(counter.drives(received[k : k + 1]) for k in range(len(received))) == 2
