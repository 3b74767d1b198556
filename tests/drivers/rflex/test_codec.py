"""The frames byte for byte, with and without escapes; a decoder that any bytes leave in step."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest

from drivers.rflex.codec import (
    ESCAPED_MAX,
    FRAME_MAX,
    AxisReport,
    Decoder,
    Frame,
    Input,
    checksum,
    direction_of,
    encode,
    frame_of,
    report_of,
    sonar_delays_of,
)
from tests.drivers.rflex.vectors import COMMANDS, REPORTS

STOP = encode(Frame(2, 11))


@pytest.mark.parametrize("text", COMMANDS)
def test_commands(text: str) -> None:
    frame = COMMANDS[text]
    assert encode(frame) == bytes.fromhex(text)
    assert Decoder().feed(bytes.fromhex(text)) == [frame]


@pytest.mark.parametrize("text", REPORTS)
def test_reports(text: str) -> None:
    number, report = REPORTS[text]
    assert encode(frame_of(report, number)) == bytes.fromhex(text)
    (frame,) = Decoder().feed(bytes.fromhex(text))
    assert (frame.number, report_of(frame)) == (number, report)


def test_the_fields_of_commands() -> None:
    frames = list(COMMANDS.values())
    assert direction_of(frames[-1]) == (1, -17671, 100000)
    assert sonar_delays_of(frames[9]) == (30_000, True)
    with pytest.raises(ValueError, match="at most 255"):
        encode(Frame(1, 1, bytes(256)))


def test_an_input_may_be_shorter_and_what_is_not_known_stays_a_frame() -> None:
    assert report_of(Frame(5, 1, bytes.fromhex("0001E2404205"))) == Input(123456, 0x42, 5)
    for odd in (Frame(2, 33, bytes(24)), Frame(4, 2, bytes(9)), Frame(6, 1), Frame(1, 1, bytes(8))):
        assert report_of(odd) is odd


def escaped(frame: Frame) -> bytes:
    """Return a frame as a robot sends it that escapes: a NUL after each ESC."""
    plain = encode(frame)
    return plain[:2] + plain[2:-2].replace(b"\x1b", b"\x1b\x00") + plain[-2:]


def test_an_escape_in_the_data_is_read_both_ways() -> None:
    report = frame_of(AxisReport(0x1B021B03, 0, 0x1B1B00, 0x1B), 0x1B)
    for sent in (encode(report), escaped(report).replace(b"\x1b\x00\x1b\x00", b"\x1b\x00\x1b")):
        decoder = Decoder()
        found = [frame for byte in sent + STOP for frame in decoder.feed(bytes((byte,)))]
        assert found == [report, Frame(2, 11)]
        assert decoder.bad == 0


def test_a_filler_pair_is_removed() -> None:
    assert Decoder().feed(STOP[:4] + b"\x1b\x01" + STOP[4:]) == [Frame(2, 11)]


@pytest.mark.parametrize("at", range(2, len(STOP)))
def test_a_corrupt_frame_is_dropped_and_the_next_one_found(at: int) -> None:
    wrong = STOP[:at] + bytes((STOP[at] ^ 0x40,)) + STOP[at + 1 :]
    decoder = Decoder()
    found = decoder.feed(wrong + STOP * 40)
    assert found[-1] == Frame(2, 11)
    assert len(found) >= 30
    assert decoder.bad > 0


def check_noise(blocks: int, seed: int) -> str:
    """Decode noise, pieces of frames and flipped bits: chunked as whole, bounded, in step after it."""
    rng = random.Random(seed)
    good = [bytes.fromhex(text) for text in (*COMMANDS, *REPORTS)]
    chunked, whole, held, total = Decoder(), Decoder(), 0, 0
    for _ in range(blocks):
        parts = [rng.choice(good) for _ in range(5)] + [rng.randbytes(30), bytes(rng.choices((0, 1, 2, 3, 27), k=60))]
        rng.shuffle(parts)
        block = bytearray(b"".join(parts))
        for _ in range(rng.randrange(4)):
            block[rng.randrange(len(block))] ^= 1 << rng.randrange(8)
        size = rng.choice((1, 3, 16, 200))
        found = [f for at in range(0, len(block), size) for f in chunked.feed(bytes(block[at : at + size]))]
        assert found == whole.feed(bytes(block))
        for frame in found:
            report_of(frame)
        held, total = max(held, chunked.pending), total + len(block)
        assert chunked.feed(STOP * 70)[-1:] == whole.feed(STOP * 70)[-1:] == [Frame(2, 11)]
    assert held <= ESCAPED_MAX
    assert (chunked.frames, chunked.bad) == (whole.frames, whole.bad)
    return f"rflex, {total:,} bytes of noise: {chunked.bad:,} dropped, ≤ {held} held"


@pytest.mark.promise("P4")
def test_noise_is_survived_in_any_chunks(measured: Callable[[str], None]) -> None:
    measured(check_noise(300, 7))


@pytest.mark.soak
@pytest.mark.promise("P4")
def test_ten_million_bytes(measured: Callable[[str], None]) -> None:
    measured(check_noise(54_000, 8))


def test_the_longest_frame() -> None:
    frame = Frame(1, 0, bytes(255))
    assert len(encode(frame)) == FRAME_MAX
    assert Decoder().feed(encode(frame)) == [frame]
    assert checksum(b"\x01\x02\x04") == 7
