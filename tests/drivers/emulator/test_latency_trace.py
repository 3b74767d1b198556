"""The latency trace: a row for each whole echo that left and each whole command that came, whatever the chunks."""

from __future__ import annotations

import io

from drivers.denning.codec import encode
from drivers.denning.frames import Ack, Drive, Echo, Halt
from drivers.denning.wire_frame_counter import WireFrameCounter
from drivers.emulator.latency_trace import HEADER, LatencyTrace

ECHO = encode(Echo(0, 1000, 0, 0b11, (20, 255)))
DRIVE = encode(Drive(1, 100, 0))


def test_a_frame_counts_with_its_last_byte() -> None:
    file = io.StringIO()
    trace = LatencyTrace(file, WireFrameCounter())
    trace.sent(encode(Ack(0, 5)) + ECHO[:4], 1.0)
    trace.sent(ECHO[4:], 2.0)
    trace.received(DRIVE[:1], 2.5)
    trace.received(DRIVE[1:] + encode(Halt(2)) + DRIVE, 3.0)
    assert file.getvalue().splitlines() == [HEADER, "2.000000,echo", "3.000000,drive", "3.000000,drive"]
