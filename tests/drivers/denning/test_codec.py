"""The codec: every example both ways, any chunking, any bytes."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.denning.codec import FRAME_MAX, Decoder, crc, encode
from drivers.denning.frames import (
    CAN_LISTEN,
    FAULT,
    NO_ECHO,
    NO_ECHO_COUNT,
    Ack,
    Drive,
    Echo,
    Echo2,
    Echo3,
    Frame,
    Halt,
    Hello,
    Ident,
    Listen,
    NakCode,
    Odom,
    Pattern,
    Scan,
    Sweep,
)
from tests.drivers.vectors import BAD, GOOD, Side

U8 = st.integers(0, 255)
I16 = st.integers(-(2**15), 2**15 - 1)
I32 = st.integers(-(2**31), 2**31 - 1)
SIDES: tuple[Side, ...] = ("host", "robot")


@st.composite
def echoes(draw: st.DrawFn) -> Echo:
    mask = draw(st.integers(0, 2**24 - 1))
    tenth = st.one_of(st.just(0), st.integers(5, 255))
    tenths = draw(st.lists(tenth, min_size=mask.bit_count(), max_size=mask.bit_count()))
    return Echo(draw(U8), draw(st.integers(0, 2**32 - 1)), draw(U8), mask, tuple(tenths))


@st.composite
def fine_echoes(draw: st.DrawFn) -> Echo2:
    fired = draw(st.integers(0, 2**24 - 1))
    heard = draw(st.integers(0, 2**24 - 1)) & ~fired
    sensors = (fired | heard).bit_count()
    counts = draw(st.lists(st.integers(0, 2**16 - 1), min_size=sensors, max_size=sensors))
    return Echo2(draw(U8), draw(st.integers(0, 2**32 - 1)), draw(U8), fired, heard, tuple(counts))


@st.composite
def turned_echoes(draw: st.DrawFn) -> Echo3:
    fired = draw(st.integers(0, 2**24 - 1))
    turned = draw(st.integers(0, 2**24 - 1)) & fired
    counts = draw(st.lists(st.integers(0, 2**16 - 1), min_size=fired.bit_count(), max_size=fired.bit_count()))
    bearings = draw(st.lists(I16, min_size=turned.bit_count(), max_size=turned.bit_count()))
    return Echo3(draw(U8), draw(st.integers(0, 2**32 - 1)), draw(U8), fired, turned, tuple(counts), tuple(bearings))


sweeps = st.builds(Sweep, U8, I16, I16, U8, U8)
scans = st.builds(Scan, U8, st.lists(sweeps, min_size=1, max_size=12).map(tuple))
odoms = st.builds(Odom, U8, st.integers(0, 2**32 - 1), I32, I32, I32, I32, I16, I16, U8, U8)
patterns = st.builds(
    Pattern,
    U8,
    st.integers(0, 2**16 - 1),
    st.integers(5, 255),
    st.lists(st.integers(0, 2**24 - 1), max_size=24).map(tuple),
)


listens = st.builds(Listen, U8, st.lists(st.integers(0, 2**24 - 1), max_size=24).map(tuple))


def stuffed(body: bytes) -> bytes:
    """Return a whole frame around `body`, checksum and all, by hand."""
    raw = body + crc(body).to_bytes(2, "little")
    out = bytearray()
    for block in raw.split(b"\0"):
        assert len(block) < 254
        out += bytes((len(block) + 1,)) + block
    return bytes(out) + b"\0"


@pytest.mark.parametrize(("side", "frame", "wire"), GOOD)
def test_good_frames_both_ways(side: Side, frame: Frame, wire: str) -> None:
    assert encode(frame).hex() == wire
    decoder = Decoder(side)
    assert decoder.feed(bytes.fromhex(wire)) == [frame]
    assert (decoder.frames, decoder.bad, decoder.lost, decoder.rejected) == (1, 0, 0, [])


@pytest.mark.parametrize(("side", "frame", "wire"), GOOD)
def test_frames_of_the_other_side_are_unknown(side: Side, frame: Frame, wire: str) -> None:
    decoder = Decoder("robot" if side == "host" else "host")
    assert decoder.feed(bytes.fromhex(wire)) == []
    assert decoder.bad == 1
    assert decoder.take_rejected() == [(frame.seq, NakCode.UNKNOWN_TYPE)]


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize(("why", "wire"), BAD)
def test_corrupt_frames_are_counted_and_the_frames_after_them_decoded(side: Side, why: str, wire: str) -> None:
    decoder = Decoder(side)
    assert decoder.feed(bytes.fromhex(wire)) == [], why
    assert (decoder.frames, decoder.bad) == (0, 1)
    good_side = [(frame, bytes.fromhex(good)) for which, frame, good in GOOD if which == side]
    assert decoder.feed(b"".join(good for _, good in good_side)) == [frame for frame, _ in good_side]
    assert decoder.bad == 1


@pytest.mark.parametrize("side", SIDES)
def test_byte_by_byte_is_the_same_as_whole(side: Side) -> None:
    data = b"".join(bytes.fromhex(wire) for _, wire in BAD)
    data += b"\0\0" + b"".join(bytes.fromhex(wire) for which, _, wire in GOOD if which == side) + data
    whole, single = Decoder(side), Decoder(side)
    frames = whole.feed(data)
    assert [f for i in range(len(data)) for f in single.feed(data[i : i + 1])] == frames
    assert frames == [frame for which, frame, _ in GOOD if which == side]
    assert (single.frames, single.bad, single.lost) == (whole.frames, whole.bad, whole.lost)
    assert single.rejected == whole.rejected


def test_a_refused_frame_keeps_its_number_and_the_reason() -> None:
    decoder = Decoder("host")
    for body in (
        bytes((0x7F, 10)),
        bytes((0x10, 11, 1, 2, 3)),
        bytes((0x11, 12, 0)),
        bytes((0x02, 13)),
        bytes((0x02, 14, 2, 50, 0, 255, 1, 1, 1)),
        bytes((0x02, 15, 25, 50, 0, 255)) + b"\1" * 75,
        bytes((0x02, 16, 1, 50, 0, 4, 1, 1, 1)),
        bytes((0x03, 17)),
        bytes((0x03, 18, 2, 1, 1, 1)),
        bytes((0x03, 19, 25)) + b"\1" * 75,
    ):
        assert decoder.feed(stuffed(body)) == []
    assert decoder.take_rejected() == [
        (10, NakCode.UNKNOWN_TYPE),
        (11, NakCode.WRONG_LENGTH),
        (12, NakCode.WRONG_LENGTH),
        (13, NakCode.WRONG_LENGTH),
        (14, NakCode.WRONG_LENGTH),
        (15, NakCode.VALUE_OUT_OF_RANGE),
        (16, NakCode.VALUE_OUT_OF_RANGE),
        (17, NakCode.WRONG_LENGTH),
        (18, NakCode.WRONG_LENGTH),
        (19, NakCode.VALUE_OUT_OF_RANGE),
    ]
    assert decoder.take_rejected() == []
    assert (decoder.frames, decoder.bad, decoder.lost) == (0, 10, 0)


def test_an_identity_whose_name_is_not_text_is_refused() -> None:
    good = encode(Ident(0, 1, 24, 381, 500, 20, 7, "x" * 16))
    assert len(Decoder("robot").feed(good)) == 1
    head = bytes((0x81, 0, 1, 24, 125, 1, 244, 1, 20, 0, 7, 0, 0, 0))
    for name in (b"\xff".ljust(16, b"\0"), b"a\0b".ljust(16, b"\0")):
        decoder = Decoder("robot")
        assert decoder.feed(stuffed(head + name)) == []
        assert decoder.rejected == [(0, NakCode.VALUE_OUT_OF_RANGE)]


def test_an_identity_whose_ranges_have_no_unit_is_refused() -> None:
    decoder = Decoder("robot")
    head = bytes((0x81, 0, 2, 24, 125, 1, 244, 1, 20, 0, 7, 0, 0, 0))
    assert decoder.feed(stuffed(head + b"x" * 16 + bytes(3))) == []
    assert decoder.rejected == [(0, NakCode.VALUE_OUT_OF_RANGE)]


def test_an_identity_with_a_name_field_of_another_length_is_refused() -> None:
    body = bytes((0x81, 0, 1, 24, 125, 1, 244, 1, 20, 0, 7, 0, 0, 0))
    for name in (b"", b"x" * 15, b"x" * 17):
        decoder = Decoder("robot")
        assert decoder.feed(stuffed(body + name)) == []
        assert decoder.rejected == [(0, NakCode.WRONG_LENGTH)]


def test_a_name_is_sent_whole_with_a_question_mark_for_what_utf_8_cannot_encode() -> None:
    for name, heard in (("BOX", "BOX"), ("", ""), ("\ud800", "?")):
        (ident,) = Decoder("robot").feed(encode(Ident(0, 1, 24, 381, 500, 20, 7, name)))
        assert isinstance(ident, Ident)
        assert ident.name == heard


def test_the_longest_pattern_and_the_nearest_echo() -> None:
    longest = Pattern(0, 50, 255, tuple(range(1, 25)))
    assert Decoder("host").feed(encode(longest)) == [longest]
    for tenths in range(1, 5):
        decoder = Decoder("robot")
        assert decoder.feed(stuffed(bytes((0x91, 0, 0, 0, 0, 0, 0, 1, 0, 0, tenths)))) == []
        assert decoder.rejected == [(0, NakCode.VALUE_OUT_OF_RANGE)]


def test_gaps_in_the_sequence_are_counted_across_the_wrap() -> None:
    decoder = Decoder("host")
    for seq in (250, 251, 255, 0, 2, 2):
        decoder.feed(encode(Halt(seq)))
    assert (decoder.frames, decoder.lost) == (6, 3 + 1)


def test_an_overlong_frame_counts_once_and_is_not_buffered() -> None:
    decoder = Decoder("robot")
    for _ in range(100):
        assert decoder.feed(b"\x55" * 100) == []
        assert decoder.pending <= FRAME_MAX + 1
    assert decoder.bad == 1
    assert decoder.feed(b"\0" + encode(Ack(0, 0))) == [Ack(0, 0)]
    assert decoder.bad == 1


def test_the_longest_frame_passes_and_one_byte_more_does_not() -> None:
    decoder = Decoder("robot")
    decoder.feed(stuffed(b"\x7f" * (FRAME_MAX - 2)))
    assert decoder.take_rejected() == [(0x7F, NakCode.UNKNOWN_TYPE)]
    decoder.feed(stuffed(b"\x7f" * (FRAME_MAX - 1)))
    assert (decoder.take_rejected(), decoder.bad) == ([], 2)


def test_the_list_of_refused_frames_is_bounded() -> None:
    decoder = Decoder("host")
    for seq in range(256):
        decoder.feed(stuffed(bytes((0x7F, seq))))
    assert [seq for seq, _ in decoder.rejected] == list(range(192, 256))


@given(st.lists(st.binary(max_size=400), max_size=12), st.sampled_from(SIDES))
def test_the_decoder_recovers_from_any_bytes(chunks: list[bytes], side: Side) -> None:
    decoder, whole = Decoder(side), Decoder(side)
    frames = []
    for chunk in chunks:
        frames += decoder.feed(chunk)
        assert decoder.pending <= FRAME_MAX + 1
    assert frames == whole.feed(b"".join(chunks))
    last = Halt(1) if side == "host" else Ack(1, 1)
    assert decoder.feed(b"\0" + encode(last)) == [last]


@given(
    st.sampled_from([0x01, 0x02, 0x03, 0x10, 0x11, 0x12, 0x81, 0x82, 0x83, 0x90, 0x91, 0x92]), st.binary(max_size=124)
)
def test_any_payload_is_a_frame_that_encodes_to_itself_or_refused(kind: int, payload: bytes) -> None:
    wire = stuffed(bytes((kind, 9)) + payload)
    decoder = Decoder("host" if kind < 0x80 else "robot")
    frames = decoder.feed(wire)
    assert len(frames) + len(decoder.rejected) == 1
    assert all(encode(frame) == wire for frame in frames)


@given(st.one_of(odoms, echoes(), fine_echoes(), turned_echoes(), patterns, listens, scans))
def test_any_frame_is_decoded_as_it_was_encoded(frame: Frame) -> None:
    decoder = Decoder("host" if isinstance(frame, Pattern | Listen | Scan) else "robot")
    assert decoder.feed(encode(frame)) == [frame]


@given(st.lists(odoms, min_size=1, max_size=4), st.data())
def test_one_flipped_bit_never_passes_as_another_frame(frames: list[Odom], data: st.DataObject) -> None:
    wire = bytearray(b"".join(encode(frame) for frame in frames))
    wire[data.draw(st.integers(0, len(wire) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    assert [f for f in Decoder("robot").feed(bytes(wire)) if f not in frames] == []


ODOM = Odom(0, 0, 0, 0, 0, 0, 0, 0, 0, 0)


@pytest.mark.parametrize(
    ("frame", "field", "limits"),
    [
        (Halt(256), "Halt.seq", "0 to 255"),
        (Hello(0, -1), "Hello.version", "0 to 255"),
        (Drive(0, 32768, 0), "Drive.v_mm_s", "-32768 to 32767"),
        (Drive(0, 0, 0.5), "Drive.w_mrad_s", "whole number"),  # type: ignore[arg-type]
        (Pattern(0, 65536, 255, ()), "Pattern.step_period_ms", "0 to 65535"),
        (Pattern(0, 50, 4, ()), "Pattern.window", "5 to 255"),
        (Pattern(0, 50, 256, ()), "Pattern.window", "5 to 255"),
        (Pattern(0, 50, 255, (1,) * 25), "Pattern.masks", "0 to 24"),
        (Pattern(0, 50, 255, (1, 1 << 24)), "Pattern.masks[1]", "0 to 16777215"),
        (replace(ODOM, t_us=2**32), "Odom.t_us", "0 to 4294967295"),
        (replace(ODOM, x_0p1mm=2**31), "Odom.x_0p1mm", "-2147483648 to 2147483647"),
        (Echo(0, 0, 0, 1 << 24, (9,)), "Echo.mask", "0 to 16777215"),
        (Echo(0, 0, 0, 3, (9,)), "Echo.tenths_ft", "asks for 2"),
        (Echo(0, 0, 0, 3, (9, 4)), "Echo.tenths_ft[1]", "5 to 255"),
        (Ident(0, 1, 24, 1, 1, 1, 1, "x" * 17), "Ident.name", "16 bytes"),
        (Ident(0, 1, 24, 1, 1, 1, 1, "a\0b"), "Ident.name", "without a zero"),
        (Ident(0, 2, 24, 1, 1, 1, 1, "a"), "Ident.range_unit_um", "1 to 65535"),
        (Ident(0, 2, 24, 1, 1, 1, 1, "a", 1, 256), "Ident.capabilities", "0 to 255"),
        (Listen(0, (1,) * 25), "Listen.masks", "0 to 24"),
        (Echo2(0, 0, 0, 1 << 24, 0, (9,)), "Echo2.fired", "0 to 16777215"),
        (Echo2(0, 0, 0, 0, 1 << 24, (9,)), "Echo2.heard", "0 to 16777215"),
        (Echo2(0, 0, 0, 3, 0, (9,)), "Echo2.counts", "asks for 2"),
        (Echo2(0, 0, 0, 3, 1, (9, 9)), "Echo2.heard", "cannot listen"),
        (Echo2(0, 0, 0, 3, 0, (9, 65536)), "Echo2.counts[1]", "0 to 65535"),
    ],
)
def test_a_value_out_of_range_is_refused_and_its_field_named(frame: Frame, field: str, limits: str) -> None:
    with pytest.raises(ValueError, match=r"must be|asks? for|cannot listen") as caught:
        encode(frame)
    assert field in str(caught.value)
    assert limits in str(caught.value)


@pytest.mark.parametrize(
    "frame",
    [Listen(5, (1,) * 24), Ident(5, 1, 24, 381, 500, 50, 7, "ring"), Ident(5, 2, 24, 381, 500, 50, 7, "ring", 1, 0)],
    ids=["most", "v1", "finest unit, hears nothing"],
)
def test_the_longest_list_and_the_shortest_ident_come_back(frame: Frame) -> None:
    side: Side = "robot" if isinstance(frame, Ident) else "host"
    assert Decoder(side).feed(encode(frame)) == [frame]


def test_the_numbers_that_the_protocol_names() -> None:
    assert (NO_ECHO, FAULT, NO_ECHO_COUNT, CAN_LISTEN) == (255, 0, 0xFFFF, 1)


@pytest.mark.parametrize("midway", [True, False])
def test_the_rest_of_a_frame_that_began_before_the_line_opened_does_not_count_as_corrupt(midway: bool) -> None:
    whole = encode(Ack(3, 7))
    for cut in range(1, len(whole) - 1):
        decoder = Decoder("robot", midway=midway)
        assert decoder.feed(whole[cut:] + encode(Ack(4, 8))) == [Ack(4, 8)]
        assert (decoder.frames, decoder.bad, decoder.lost) == (1, 0 if midway else 1, 0)
        decoder.feed(whole[cut:])
        assert decoder.bad == (1 if midway else 2), "later pieces count"
    decoder = Decoder("robot", midway=midway)
    decoder.feed(b"\xff" * 1000 + b"\0")
    assert decoder.bad == 1, "no frame is as long as that"
