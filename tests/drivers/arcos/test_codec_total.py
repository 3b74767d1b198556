"""P4 for the Pioneer: its decoder and its driver survive any bytes, hold one frame at most, and find the next one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from drivers.arcos.codec import FRAME_MAX, Decoder, decode_command, decode_packet, encode
from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.frames import Packet, SyncEcho
from drivers.driver import LineState
from tests.drivers.arcos.harness import Harness
from tests.drivers.arcos.noise import Side, blocks
from tests.drivers.arcos.vectors import TAIL

pytestmark = pytest.mark.promise("P4")

SIDES: tuple[Side, ...] = ("host", "robot")
CHUNKS = (1, 2, 3, 7, 16, 61, 256, 4096)
Measured = Callable[[str], None]


def decoder(side: Side) -> Decoder[Command] | Decoder[Packet]:
    return Decoder(decode_command) if side == "host" else Decoder(decode_packet)


def check_noise(side: Side, seed: int, total: int) -> str:
    """Decode noise chunked and whole: the same frames, each of which is encoded again; whatever follows is found."""
    rng = np.random.default_rng(seed + 1)
    chunked, whole, held = decoder(side), decoder(side), 0
    marker = encode(Command(CommandNumber.STOP) if side == "host" else SyncEcho(1))
    for block in blocks(side, seed, total):
        size = CHUNKS[rng.integers(0, len(CHUNKS))]
        found: list[Command | Packet] = []
        for start in range(0, len(block), size):
            found += chunked.feed(block[start : start + size])
            held = max(held, chunked.pending)
        assert chunked.pending < FRAME_MAX
        assert found == whole.feed(block)
        assert (chunked.frames, chunked.bad) == (whole.frames, whole.bad)
        for message in found:
            assert encode(message)[:2] == b"\xfa\xfb"
        after = chunked.feed(marker * 44)
        assert after == whole.feed(marker * 44)
        assert after, "no false header holds back more than 258 bytes"
        assert chunked.skip() == whole.skip()
        assert chunked.pending == 0
    assert chunked.frames > 1e-3 * total
    assert chunked.bad > 1e-3 * total
    return f"{total:.0e} bytes from the {side}: {chunked.frames:,} frames, {chunked.bad:,} dropped, ≤ {held} held"


def check_driver(seed: int, total: int) -> str:
    """Feed noise to the driver in every state; it goes on, stays within its memory, and connects again."""
    harness = Harness()
    harness.ready()
    downs = 0
    for block in blocks("robot", seed, total):
        for start in range(0, len(block), 200):
            harness.to_driver(block[start : start + 200])
            harness.run(0.02)
        downs += harness.state() is not LineState.READY
        harness.received.clear()
        harness.states.clear()
        assert harness.driver.firings_waiting <= 1024
    harness.controller.session, harness.controller.baud = "wait", 9600
    harness.to_driver(bytes(300))
    harness.run(10.0)
    assert harness.state() is LineState.READY
    assert abs(harness.driver.odometry_origin.theta) < 1e6
    return f"{total:.0e} bytes of noise among its SIPs: {downs} blocks took the line down, and it is READY after them"


@pytest.mark.parametrize("side", SIDES)
def test_noise_of_every_kind_is_survived(side: Side, measured: Measured) -> None:
    measured(check_noise(side, 50, 100_000))


def test_the_driver_survives_noise(measured: Measured) -> None:
    measured(check_driver(52, 30_000))


@pytest.mark.soak
@pytest.mark.parametrize("side", SIDES)
def test_ten_million_bytes(side: Side, measured: Measured) -> None:
    measured(check_noise(side, 51, 10_000_000))


@pytest.mark.soak
def test_the_driver_survives_a_million_bytes(measured: Measured) -> None:
    measured(check_driver(53, 1_000_000))


def test_a_frame_that_a_false_header_hides_is_found_when_its_end_has_come() -> None:
    found = Decoder(decode_packet)
    sip = encode(TAIL)
    assert [len(found.feed(sip)) for _ in range(9)] == [1] * 9
    found.feed(b"\xfa\xfb\xff")
    counts = [len(found.feed(sip)) for _ in range(8)]
    assert counts[:6] == [0] * 6
    assert sum(counts) == 8
