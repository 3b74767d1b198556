"""The codec: every example both ways, any chunking, packets that end early, and malformed ones."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.arcos.codec import FRAME_MAX, Decoder, checksum, decode_command, decode_packet, encode
from drivers.arcos.commands import Command
from drivers.arcos.frames import (
    AuxPacket,
    ConfigPacket,
    GyroPacket,
    IoPacket,
    Other,
    Packet,
    Sip,
    SonarReading,
)
from tests.drivers.arcos.vectors import COMMANDS, MOVING, P3DX, PACKETS, TAIL

U8 = st.integers(0, 255)
U16 = st.integers(0, 2**16 - 1)
I16 = st.integers(-(2**15), 2**15 - 1)
readings = st.lists(st.builds(SonarReading, U8, U16), max_size=70).map(tuple)
sips = st.builds(Sip, st.integers(0x30, 0x34), I16, I16, I16, I16, I16, U8, U8, U8, I16, U16, U8, readings)
arguments = st.one_of(st.none(), st.integers(-0xFFFF, 0xFFFF), st.binary(max_size=200))


def body_of(message: Command | Packet) -> bytes:
    return encode(message)[3:-2]


@pytest.mark.parametrize(("command", "wire"), COMMANDS)
def test_commands_both_ways(command: Command, wire: str) -> None:
    assert encode(command).hex() == wire
    decoder = Decoder(decode_command)
    assert decoder.feed(bytes.fromhex(wire)) == [command]
    assert (decoder.frames, decoder.bad, decoder.pending) == (1, 0, 0)


@pytest.mark.parametrize(("packet", "wire"), PACKETS)
def test_packets_both_ways(packet: Packet, wire: str) -> None:
    assert encode(packet).hex() == wire
    decoder = Decoder(decode_packet)
    assert decoder.feed(bytes.fromhex(wire)) == [packet]
    assert (decoder.frames, decoder.bad, decoder.pending) == (1, 0, 0)


@given(st.integers(0, 255), arguments)
def test_every_command_both_ways(number: int, argument: int | bytes | None) -> None:
    command = Command(number, argument)
    assert decode_command(body_of(command)) == command


@given(sips)
def test_every_sip_both_ways(sip: Sip) -> None:
    assert decode_packet(body_of(sip)) == sip


@given(st.binary(min_size=1, max_size=253))
def test_any_body_is_encoded_again_byte_for_byte(body: bytes) -> None:
    assert body_of(decode_packet(body)) == body
    assert body_of(decode_command(body)) == body


@given(st.binary(max_size=60))
def test_the_checksum_adds_pairs_of_bytes(body: bytes) -> None:
    total = 0
    for i in range(0, len(body) - 1, 2):
        total = (total + 256 * body[i] + body[i + 1]) % 65536
    assert checksum(body) == (total ^ body[-1] if len(body) % 2 else total)


@pytest.mark.parametrize("packet", [TAIL, P3DX])
def test_a_packet_may_end_after_any_byte(packet: Packet) -> None:
    whole = body_of(packet)
    for length in range(21 if packet is TAIL else 1, len(whole) + 1):
        short = decode_packet(whole[:length])
        assert isinstance(short, Sip | ConfigPacket)
        assert body_of(short) == whole[:length]
        names = [name for name in packet.__dataclass_fields__ if name != "extra"]
        values = [getattr(short, name) for name in names]
        known = values.index(None) if None in values else len(values)
        assert all(getattr(packet, name) == value for name, value in zip(names[:known], values, strict=False))


def test_newer_controllers_append_fields_and_may_append_more() -> None:
    longer = replace(TAIL, controller_us=0xFFFF_FFFF, flags_3=7, extra=b"new")
    assert decode_packet(body_of(longer)) == longer
    config = replace(
        P3DX,
        pdb_port=1,
        gyro_rate_limit=2,
        high_temperature_shutdown=-3,
        power_bits=4,
        battery_type=5,
        charge_low=6,
        charge_shutdown=7,
        bootloader="b",
        config_flags=8,
        gyro_firmware=-9,
        extra=b"new",
    )
    assert decode_packet(body_of(config)) == config


def test_announced_ranges_that_are_missing_are_not_read_from_the_tail() -> None:
    body = bytearray(body_of(TAIL))
    body[19] = 16
    sip = decode_packet(bytes(body))
    assert sip == replace(TAIL, missing=16)
    assert body_of(sip) == bytes(body)


@pytest.mark.parametrize("kind", [0x30, 0x31, 0x34])
def test_other_types_of_sip_are_sips(kind: int) -> None:
    sip = replace(MOVING, kind=kind)
    assert decode_packet(body_of(sip)) == sip


@pytest.mark.parametrize(
    "body", [b"\x98", b"\x98\x02\0\0\0", b"\xf0", b"\xf0\x01", b"\xf0\0\0\x01\0", b"\x90" + bytes(7), b"\xf8\0"]
)
def test_packets_shorter_than_their_layout_are_kept_as_bytes(body: bytes) -> None:
    assert decode_packet(body) == Other(body[0], body[1:])


@pytest.mark.parametrize(
    "message",
    [
        Command(256),
        Command(11, 70_000),
        Command(42, bytes(300)),
        replace(MOVING, x=40_000),
        replace(P3DX, name="a\0b"),
        GyroPacket(((70_000, 0),)),
        IoPacket(bytes(256), b"", ()),
        AuxPacket(4, b""),
    ],
)
def test_a_field_that_does_not_fit_is_named(message: Command | Packet) -> None:
    with pytest.raises(ValueError, match=rf"{type(message).__name__}\.\w+"):
        encode(message)


@pytest.mark.parametrize("message", [Command(42, bytes(252)), replace(MOVING, sonar=(SonarReading(1, 2),) * 80)])
def test_what_is_longer_than_a_frame_is_refused(message: Command | Packet) -> None:
    with pytest.raises(ValueError, match="a frame holds 1 to 253"):
        encode(message)


def test_a_corrupt_frame_costs_only_itself() -> None:
    good = bytes.fromhex(PACKETS[4][1])
    for at in range(len(good)):
        for bit in (1, 0x80):
            corrupt = bytearray(good)
            corrupt[at] ^= bit
            decoder = Decoder(decode_packet)
            found = decoder.feed(bytes(corrupt) + good * 12)
            assert found[-12:] == [MOVING] * 12
            assert len(found) == 12


def test_a_false_header_costs_no_frame_after_it() -> None:
    good = bytes.fromhex(PACKETS[4][1])
    for noise in ("fa", "fafa", "fafbfa", "fafb00", "fafb02", "fafbff", "fafb1000"):
        decoder = Decoder(decode_packet)
        assert decoder.feed(bytes.fromhex(noise) + good * 10) == [MOVING] * 10


def test_a_frame_whose_rest_does_not_come_is_given_up() -> None:
    decoder = Decoder(decode_packet)
    sync = bytes.fromhex("fafb03000000")
    assert decoder.feed(b"\xfa\xfb\xff" + sync + sync + b"\xfa") == []
    assert decoder.skip() == [decode_packet(b"\0")] * 2
    assert (decoder.pending, decoder.bad) == (0, 1)
    assert decoder.skip() == []


@given(st.data())
def test_splitting_makes_no_difference(data: st.DataObject) -> None:
    parts = data.draw(
        st.lists(st.one_of(st.sampled_from([bytes.fromhex(w) for _, w in PACKETS]), st.binary(max_size=9)))
    )
    stream = b"".join(parts)
    whole, single = Decoder(decode_packet), Decoder(decode_packet)
    found = whole.feed(stream)
    assert [f for i in range(len(stream)) for f in single.feed(stream[i : i + 1])] == found
    assert (single.frames, single.bad, single.pending) == (whole.frames, whole.bad, whole.pending)
    assert whole.pending < FRAME_MAX
