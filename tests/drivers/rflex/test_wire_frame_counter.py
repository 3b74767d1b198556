"""Counting of sonar reports and of velocities, in bytes split anywhere."""

from __future__ import annotations

from drivers.rflex.wire_frame_counter import WireFrameCounter
from tests.drivers.rflex.vectors import COMMANDS, REPORTS


def test_ranges_and_velocities_are_counted() -> None:
    counter = WireFrameCounter()
    sent = b"".join(map(bytes.fromhex, REPORTS))
    assert sum(counter.echoes(sent[k : k + 1]) for k in range(len(sent))) == 1
    received = b"".join(map(bytes.fromhex, COMMANDS))
    assert sum(counter.drives(received[k : k + 1]) for k in range(len(received))) == 1, "one translation"
