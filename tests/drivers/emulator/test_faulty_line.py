"""The robot's end of its line: speed, and the faults of each direction."""

from __future__ import annotations

import numpy as np

from drivers.emulator.fault_schedule import FaultSchedule
from drivers.emulator.faulty_line import FaultyLine
from tests.drivers.device_host import script


def make(**fault: object) -> FaultyLine:
    """Return a line on which the fault is active."""
    faults = FaultSchedule(())
    if fault:
        faults.set_active(script(at_s=0.0, **fault)[0], on=True)
    return FaultyLine(9600, faults, np.random.default_rng(1), np.random.default_rng(2))


def sent(line: FaultyLine, data: bytes, until_us: int = 1_000_000) -> bytes:
    line.send(data, 0)
    line.collect(until_us)
    return line.take()


def test_bytes_leave_at_the_speed_that_is_set() -> None:
    line = make()
    assert sent(line, bytes(100), 10_000) == bytes(9)
    line.set_baud(96_000, 10_000)
    assert line.empty_us is not None
    assert 19_000 < line.empty_us < 21_000
    line.collect(20_600)
    assert line.take() == bytes(91)
    assert line.take() == b""


def test_faults_of_the_line() -> None:
    data = bytes(range(256))
    assert (sent(make(), data), make().heard(data)) == (data, data)
    assert sent(make(kind="mute"), data) == b""
    assert make(kind="deaf").heard(data) == b""
    unplugged = make(kind="unplug")
    assert (unplugged.plugged, sent(unplugged, data), unplugged.heard(data)) == (False, b"", b"")
    noisy = make(kind="bit_errors", rate=0.1)
    assert sent(noisy, data) != data
    assert noisy.heard(data) != data


def test_garbage_comes_at_its_rate_between_the_frames() -> None:
    line = make(kind="garbage", bytes_per_s=500.0)
    for k in range(1000):
        line.add_garbage(1000 * k, 5000)
    line.collect(2_000_000)
    assert len(line.take()) == 2 * 200
    line.clear()
    assert line.empty_us is None


def test_a_frame_that_does_not_fit_is_counted() -> None:
    line = make()
    line.send(bytes(1000), 0)
    line.send(bytes(1000), 0)
    assert line.dropped == 1
