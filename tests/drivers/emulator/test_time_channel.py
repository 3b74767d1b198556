"""The emulated robot's bytes come at the line's speed and at their own time, the same way every time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.robot import RingConfig
from config.world import WorldConfig
from drivers.denning.codec import Decoder, encode
from drivers.denning.frames import (
    Drive,
    Echo,
    Hello,
    Ident,
    Odom,
    Pattern,
)
from drivers.driver import LineState, Received
from drivers.emulator.faults import Fault
from drivers.emulator.memory_transport import MemoryLine
from drivers.emulator.uart import QUEUE_MAX, Uart
from drivers.messages import Identity, LinkCounts, Pose, Twist
from drivers.registry import make_device
from tests.drivers.emulated import ALL, WORLD, host, next_event_s, robot_config, script
from tests.drivers.vectors import THIRDS

# The line.


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


@settings(deadline=None)
@given(
    sends=st.lists(st.tuples(st.integers(0, 3000), st.binary(min_size=1, max_size=60)), max_size=40),
    looks=st.lists(st.integers(0, 200_000), max_size=20),
    baud=st.sampled_from([300, 9600, 115200, 4_000_000]),
)
def test_transmitter_gives_the_same_bytes_however_often_one_looks(
    sends: list[tuple[int, bytes]], looks: list[int], baud: int
) -> None:
    def run(moments: list[int]) -> tuple[bytes, bytes]:
        uart, sent, got = Uart(baud), b"", b""
        at = 0
        for gap, data in sends:
            for moment in [m for m in moments if at < m <= at + gap]:
                got += uart.take(moment)
            at += gap
            got += uart.take(at)
            before = uart.dropped
            uart.send(data, at)
            sent += data if uart.dropped == before else b""
        got += uart.take(at + 1000)
        early = got
        return early, got + uart.take(at + 40_000_000) if sent else got

    often, seldom = run(sorted(looks)), run([])
    assert often == seldom


def test_transmitter_byte_times_are_exact() -> None:
    uart = Uart(115200)
    uart.send(bytes(range(10)), 1000)
    assert uart.take(1086) == b""
    assert uart.take(1087) == b"\x00"
    assert uart.empty_us == 1869
    assert uart.take(1868) == bytes(range(1, 9))
    uart.send(b"x", 1868)
    assert uart.take(1869) == b"\x09"
    assert uart.empty_us == 1955
    uart.send(bytes(QUEUE_MAX), 1869)
    assert uart.dropped == 1


# Determinism.


def long_run(seed: int, steps: Sequence[float]) -> bytes:
    h = host(seed=seed, faults=script(kind="bit_errors", at_s=1.0, duration_s=0.5, rate=0.001))
    h.send(Hello, 1)
    h.send(Pattern, 50, 255, THIRDS)
    for command in range(20):
        h.send(Drive, 300, 20 * command - 200)
        begin = h.now
        for share in [*steps, 1.0]:
            h.now = begin + 0.1 * share
            h.raw += h.robot.advance(h.now)
    return bytes(h.raw)


def test_same_seed_same_bytes() -> None:
    assert long_run(3, ()) == long_run(3, ())
    assert long_run(3, ()) != long_run(4, ())


@settings(max_examples=15, deadline=None)
@given(steps=st.lists(st.floats(0, 1), max_size=12).map(sorted))
def test_it_does_not_matter_how_time_is_cut(steps: list[float]) -> None:
    assert long_run(3, steps) == long_run(3, ())


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
def test_any_bytes_leave_it_alive(data: bytes) -> None:
    h = host(WorldConfig())
    h.robot.receive(data + b"\0")
    h.send(Hello, 1)
    h.run(0.1, step=0.05)
    assert len(h.of(Ident)) >= 1
    assert h.decoder.bad == 0


# In memory.


class PlainDriver:
    """As little driver as can be: greets, sets a pattern, writes down."""

    def __init__(self) -> None:
        self.decoder = Decoder("robot")
        self.log: list[tuple[float, object]] = []
        self.ticks: list[float] = []
        self._out = b""

    state = LineState.READY
    problem: str | None = None
    identity: Identity | None = None
    counts = LinkCounts()

    def line_opened(self, run_s: float) -> None:
        self.log.append((run_s, "opened"))
        self._out += encode(Hello(0)) + encode(Pattern(1, 50, 255, THIRDS))

    def line_closed(self) -> None:
        self.log.append((math.nan, "closed"))

    def receive(self, data: bytes, now_s: float) -> None:
        self.log += [(now_s, frame) for frame in self.decoder.feed(data)]

    def tick(self, now_s: float) -> None:
        self.ticks.append(now_s)

    def drive(self, twist: Twist) -> None:
        self._out += encode(Drive(2, round(twist.v * 1e3), round(twist.w * 1e3)))

    def halt(self) -> None: ...

    def release(self) -> None: ...

    def set_firing(self, ring: RingConfig) -> None: ...

    def outgoing(self, *, writable: bool) -> bytes:
        assert writable
        out, self._out = self._out, b""
        return out

    @property
    def odometry_origin(self) -> Pose:
        return Pose(0.0, 0.0, 0.0)

    @property
    def firings_waiting(self) -> int:
        return 0

    def take_received(self) -> Received:
        return Received((), None, rebooted=False)


def memory_run(faults: Sequence[Fault] = (), cycle_s: float = 0.05) -> PlainDriver:
    driver = PlainDriver()
    line = MemoryLine(driver, make_device(robot_config(), WORLD, 1, faults=faults), start_s=100.0)
    for k in range(round(2.0 / cycle_s) + 1):
        driver.drive(Twist(0.3, 0.0))
        line.exchange(100.0 + k * cycle_s)
    return driver


def test_memory_line_joins_a_driver_and_a_robot() -> None:
    driver = memory_run()
    assert driver.log[0] == (100.0, "opened")
    arrival = {type(frame): when for when, frame in reversed(driver.log)}
    assert arrival[Ident] <= 100.0 + 0.01, "answers flow between the host's cycles"
    assert sum(isinstance(frame, Echo) for _, frame in driver.log) == 40
    assert sum(isinstance(frame, Odom) for _, frame in driver.log) >= 98
    assert driver.ticks == sorted(driver.ticks)
    assert all(100.0 <= when <= 102.0 + 1e-9 for when, _ in driver.log)


def test_memory_line_is_deterministic() -> None:
    assert memory_run().log == memory_run().log


def test_memory_line_is_pulled_out_and_put_back() -> None:
    driver = memory_run(script(kind="unplug", at_s=0.5, duration_s=0.5))
    assert [what for _, what in driver.log if isinstance(what, str)] == ["opened", "closed", "opened"]
    assert not [when for when, what in driver.log if 100.51 < when < 100.99]
    assert driver.decoder.bad <= 1
