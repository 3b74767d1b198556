"""The firmware's frames against the driver's: the same bytes, and of noise the same frames accepted and dropped."""

from __future__ import annotations

import sys
import types
from collections.abc import Callable
from typing import Any

import pytest

from drivers.denning.codec import FRAME_MAX, Decoder, encode
from drivers.denning.frames import Halt
from drivers.firmware.bundle import board_files
from tests.drivers.noise import blocks
from tests.drivers.vectors import BAD, GOOD

SLICE = 4096


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The board's module `ring/wire.py`, as this Python runs it; its decorator compiles it on a board."""
    stand_in = types.ModuleType("micropython")
    stand_in.native = lambda function: function  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "micropython", stand_in)
    module = types.ModuleType("wire")
    exec(compile(board_files("pico")["ring/wire.py"], "wire.py", "exec"), module.__dict__)
    return module


def accepted(decoder: Any, data: bytes) -> list[bytes]:
    """Return the frames that the firmware accepts: type, sequence number and payload."""
    return [bytes(decoder.frame[: decoder.length]) for byte in data if decoder.feed(byte)]


def test_it_reads_every_example_and_no_bad_one(wire: Any) -> None:
    for _, frame, text in GOOD:
        (body,) = accepted(wire.Decoder(), bytes.fromhex(text))
        assert body[1] == frame.seq
    for why, text in BAD:
        theirs = Decoder("robot")
        theirs.feed(bytes.fromhex(text))
        assert len(accepted(wire.Decoder(), bytes.fromhex(text))) == len(theirs.rejected), why


def test_it_writes_every_example_as_the_driver_does(wire: Any) -> None:
    for _, frame, text in GOOD:
        (body,) = accepted(wire.Decoder(), bytes.fromhex(text))
        sent = bytearray()
        line = types.SimpleNamespace(write=sent.extend)
        encoder = wire.Encoder(line)
        encoder._seq = frame.seq
        encoder.frame[2 : len(body)] = body[2:]
        encoder.send(body[0], len(body) - 2)
        assert sent.hex() == text


@pytest.mark.promise("P4")
@pytest.mark.parametrize("total", [60_000, pytest.param(10_000_000, marks=pytest.mark.soak)])
def test_of_any_bytes_it_accepts_the_same_frames_as_the_driver(
    wire: Any, total: int, measured: Callable[[str], None]
) -> None:
    ours, theirs = wire.Decoder(), Decoder("host")
    same = read = 0
    for noise in blocks("host", 5, total):
        for start in range(0, len(noise), SLICE):
            part = noise[start : start + SLICE]
            bodies = accepted(ours, part)
            frames = theirs.feed(part)
            refused = theirs.take_rejected()
            if len(refused) < 64:  # it keeps no more
                assert len(bodies) == len(frames) + len(refused)
            same += len(frames)
            assert ours.pending <= FRAME_MAX + 1
            assert len(ours.frame) == FRAME_MAX + 1
            read += len(part)
    good = encode(Halt(1)) + encode(Halt(2))
    assert accepted(ours, b"\0" + good)[-1] == bytes((0x11, 2))
    measured(f"firmware of a ring: {read:,} bytes, {same:,} frames, all as the driver's decoder")
