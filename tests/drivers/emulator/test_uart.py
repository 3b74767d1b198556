"""The emulated transmitter: bytes leave at the line's speed, however often they are collected."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.emulator.uart import QUEUE_MAX, Uart


@settings(deadline=None)
@given(
    sends=st.lists(st.tuples(st.integers(0, 3000), st.binary(min_size=1, max_size=60)), max_size=40),
    collections=st.lists(st.integers(0, 200_000), max_size=20),
    baud=st.sampled_from([300, 9600, 115200, 4_000_000]),
)
def test_bytes_do_not_depend_on_how_often_they_are_collected(
    sends: list[tuple[int, bytes]], collections: list[int], baud: int
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

    often, seldom = run(sorted(collections)), run([])
    assert often == seldom


def test_byte_times_are_exact() -> None:
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
