"""The emulated Denning's bytes: at the line's speed, at their own time, and the same for the same seed."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.world import WorldConfig
from drivers.denning.frames import (
    Drive,
    Hello,
    Ident,
    Pattern,
)
from tests.drivers.device_host import ALL, host, next_event_s, script
from tests.drivers.vectors import THIRDS


def test_bytes_leave_no_faster_than_the_line() -> None:
    for baud in (9600, 19200, 115200):
        h = host(baud=baud)
        h.send(Pattern, 50, 255, (ALL,))
        amounts = []
        for k in range(1, 2001):
            amounts.append(len(h.robot.advance(k * 0.001)))
            if k % 100 == 0:
                for _ in range(10):
                    h.send(Hello, 1)
        sums = [0, *itertools.accumulate(amounts)]
        for window in (1, 3, 10, 100, 1000):
            most = max(b - a for a, b in zip(sums, sums[window:], strict=False))
            assert most <= window * 0.001 * baud / 10 + 1


def test_slow_line_loses_whole_frames_as_its_sequence_numbers_show() -> None:
    h = host(baud=9600)
    h.send(Pattern, 50, 255, (ALL,))
    h.run(10.0)
    assert h.robot.dropped > 50
    assert h.decoder.bad == 0
    assert h.decoder.lost > 0
    assert len(h.raw) == pytest.approx(9600, abs=20), "a full queue keeps the line busy"


def long_run(seed: int) -> bytes:
    h = host(seed=seed, faults=script(kind="bit_errors", at_s=1.0, duration_s=0.5, rate=0.001))
    h.send(Hello, 1)
    h.send(Pattern, 50, 255, THIRDS)
    for command in range(20):
        h.send(Drive, 300, 20 * command - 200)
        h.now += 0.1
        h.raw += h.robot.advance(h.now)
    return bytes(h.raw)


def test_same_seed_same_bytes() -> None:
    assert long_run(3) == long_run(3)
    assert long_run(3) != long_run(4)


def test_advancing_event_by_event_loses_nothing() -> None:
    h, other = host(), host()
    for each in (h, other):
        each.send(Pattern, 50, 255, THIRDS)
    got = b""
    moments: list[float] = []
    while not moments or moments[-1] < 1.0:
        moments.append(next_event_s(h.robot))
        got += h.robot.advance(moments[-1])
    assert moments == sorted(moments)
    assert got == other.robot.advance(moments[-1])


@settings(deadline=None)
@given(data=st.binary(max_size=300))
def test_it_survives_any_bytes(data: bytes) -> None:
    h = host(WorldConfig())
    h.robot.receive(data + b"\0")
    h.send(Hello, 1)
    h.run(0.1, step=0.05)
    assert len(h.of(Ident)) >= 1
    assert h.decoder.bad == 0
