"""Frames to bytes and back: header, length, checksum and field layout; without I/O.

The decoder is total: for any bytes it raises no exception and keeps at most one incomplete frame. After a frame with
a wrong checksum it looks for the next header inside that frame, so that a false header costs no frame after it.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from types import MappingProxyType
from typing import Final, Generic, TypeVar

from drivers.arcos.commands import Command, Raw
from drivers.arcos.frames import (
    AuxPacket,
    BatteryPacket,
    ConfigPacket,
    EncoderPacket,
    GyroPacket,
    IoPacket,
    JoystickPacket,
    Other,
    Packet,
    ResetNotice,
    RobotName,
    Sip,
    SonarReading,
    SyncEcho,
)
from drivers.arcos.layouts import (
    AXES,
    CONFIG,
    ENCODERS,
    NAME,
    SIP_START,
    SIP_TAIL,
    Layout,
    pack,
    pack_integer,
    unpack,
)

HEADER: Final = b"\xfa\xfb"
BODY_MAX: Final = 253
"""Longest body, bytes: the length byte counts the checksum too."""
FRAME_MAX: Final = len(HEADER) + 1 + 0xFF
"""Longest frame, bytes."""
_LENGTH_MIN: Final = 3
"""Least length byte: one byte of body and the checksum."""

_POSITIVE, _NEGATIVE, _STRING = 0x3B, 0x1B, 0x2B
"""The types of an argument."""

_READING = struct.Struct("<BH")
_GYRO = struct.Struct("<HB")
_AUX_PORTS: Final = MappingProxyType({0xB0: 1, 0xB8: 2, 0xC8: 3})
_AUX_KINDS: Final = MappingProxyType({port: kind for kind, port in _AUX_PORTS.items()})

F = TypeVar("F")
P = TypeVar("P")


def checksum(body: bytes) -> int:
    """Return the checksum of a body: the sum of its byte pairs modulo 65536, exclusive-or an odd last byte."""
    even = len(body) & ~1
    total = (sum(body[0:even:2]) << 8) + sum(body[1:even:2]) & 0xFFFF
    return total ^ body[-1] if len(body) & 1 else total


def frame(body: bytes) -> bytes:
    """Return a body with header, length and checksum.

    Raises
    ------
    ValueError
        The body is empty or too long for one frame.
    """
    if not 1 <= len(body) <= BODY_MAX:
        raise ValueError(f"a body of {len(body)} bytes: a frame holds 1 to {BODY_MAX}")
    return HEADER + bytes((len(body) + 2,)) + body + checksum(body).to_bytes(2, "big")


def encode(message: Command | Packet) -> bytes:
    """Return the bytes of a command or packet.

    Raises
    ------
    ValueError
        A field does not fit, or the whole is longer than a frame; the message names the type and the cause.
    """
    body = _command_body(message) if isinstance(message, Command) else _packet_body(message)
    return frame(body)


def decode_command(body: bytes) -> Command:
    """Return the command of a body, which must not be empty."""
    number, argument = body[0], body[1:]
    if not argument:
        return Command(number)
    if len(argument) == 3 and argument[0] == _POSITIVE:
        return Command(number, int.from_bytes(argument[1:], "little"))
    if len(argument) == 3 and argument[0] == _NEGATIVE and argument[1:] != b"\0\0":
        return Command(number, -int.from_bytes(argument[1:], "little"))
    if len(argument) >= 2 and argument[0] == _STRING and argument[1] == len(argument) - 2:
        return Command(number, argument[2:])
    return Command(number, Raw(argument))


def decode_packet(body: bytes) -> Packet:
    """Return the packet of a body, which must not be empty; `Other` if its type or layout is unknown."""
    kind, data = body[0], body[1:]
    match kind:
        case 0 | 1 if not data:
            return SyncEcho(kind)
        case 2:
            return _make(RobotName, NAME, data)
        case 0x20:
            return _make(ConfigPacket, CONFIG, data)
        case 0x30 | 0x31 | 0x32 | 0x33 | 0x34:
            return _decode_sip(body)
        case 0x90 if len(data) >= 8:
            return _make(EncoderPacket, ENCODERS, data)
        case 0x98 if data and len(data) >= (end := 1 + _GYRO.size * data[0]):
            return GyroPacket(tuple(_GYRO.iter_unpack(data[1:end])), data[end:])
        case 0xF0 if (blocks := _io_blocks(data)) is not None:
            return IoPacket(*blocks)
        case 0xF8 if len(data) >= 8:
            return _make(JoystickPacket, AXES, data)
        case 0xB0 | 0xB8 | 0xC8:
            return AuxPacket(_AUX_PORTS[kind], data)
        case 0xFA:
            return BatteryPacket(data)
        case 0xFE | 0xFF:
            return ResetNotice(kind, data)
        case _:
            return Other(kind, data)


def _make(make: Callable[..., P], layout: Layout, data: bytes) -> P:
    """Return the packet of a body that holds nothing but the fields of `layout`."""
    fields, extra = unpack(layout, data)
    return make(**fields, extra=extra)


def _decode_sip(body: bytes) -> Sip | Other:
    """Return the SIP of a body; an `Other` if it ends before the count of its ranges."""
    head, rest = unpack(SIP_START, body)
    if len(head) < len(SIP_START) or not rest:
        return Other(body[0], body[1:])
    count, end, missing = rest[0], 1 + _READING.size * rest[0], 0
    if end > len(rest):
        # One simulator announces 16 ranges after sonar is switched on, and sends none.
        missing, end = count, 1
    sonar = tuple(SonarReading(*reading) for reading in _READING.iter_unpack(rest[1:end]))
    tail, extra = unpack(SIP_TAIL, rest[end:])
    return Sip(**head, sonar=sonar, missing=missing, **tail, extra=extra)


def _io_blocks(data: bytes) -> tuple[bytes, bytes, tuple[int, ...], bytes] | None:
    """Return the digital inputs and outputs, the analog inputs and the rest; None if `data` is too short for them."""
    blocks: list[bytes] = []
    at = 0
    for width in (1, 1, 2):
        if at >= len(data) or (end := at + 1 + width * data[at]) > len(data):
            return None
        blocks.append(data[at + 1 : end])
        at = end
    analog = tuple(value for (value,) in struct.iter_unpack("<H", blocks[2]))
    return blocks[0], blocks[1], analog, data[at:]


def _command_body(command: Command) -> bytes:
    """Return the body of a command.

    Raises
    ------
    ValueError
        A field does not fit its bytes.
    """
    number = pack_integer(command, "number", "B", command.number)
    match command.argument:
        case None:
            return number
        case Raw(data):
            return number + data
        case int(value):
            if abs(value) > 0xFFFF:
                raise ValueError(f"Command.argument is {value}: it must be -65535 to 65535")
            sign = _POSITIVE if value >= 0 else _NEGATIVE
            return number + bytes((sign,)) + abs(value).to_bytes(2, "little")
        case data:
            return number + bytes((_STRING,)) + pack_integer(command, "argument (its length)", "B", len(data)) + data


def _packet_body(packet: Packet) -> bytes:
    """Return the body of a packet.

    Raises
    ------
    ValueError
        A field does not fit its bytes.
    """
    match packet:
        case SyncEcho():
            return pack_integer(packet, "number", "B", packet.number)
        case RobotName():
            return b"\x02" + pack(packet, NAME) + packet.extra
        case Sip():
            return _sip_body(packet)
        case ConfigPacket():
            return b"\x20" + pack(packet, CONFIG) + packet.extra
        case EncoderPacket():
            return b"\x90" + pack(packet, ENCODERS) + packet.extra
        case GyroPacket():
            count = pack_integer(packet, "samples (their number)", "B", len(packet.samples))
            samples = (
                pack_integer(packet, "samples", "H", rate) + pack_integer(packet, "samples", "B", temperature)
                for rate, temperature in packet.samples
            )
            return b"\x98" + count + b"".join(samples) + packet.extra
        case IoPacket():
            blocks = (packet.digital_in, packet.digital_out)
            digital = b"".join(
                pack_integer(packet, "digital (its length)", "B", len(block)) + block for block in blocks
            )
            count = pack_integer(packet, "analog (its length)", "B", len(packet.analog))
            analog = b"".join(pack_integer(packet, "analog", "H", value) for value in packet.analog)
            return b"\xf0" + digital + count + analog + packet.extra
        case JoystickPacket():
            return b"\xf8" + pack(packet, AXES) + packet.extra
        case AuxPacket():
            if packet.port not in _AUX_KINDS:
                raise ValueError(f"AuxPacket.port is {packet.port}: it must be 1, 2 or 3")
            return bytes((_AUX_KINDS[packet.port],)) + packet.data
        case BatteryPacket():
            return b"\xfa" + packet.data
        case ResetNotice() | Other():
            return pack_integer(packet, "kind", "B", packet.kind) + packet.data


def _sip_body(sip: Sip) -> bytes:
    """Return the body of a SIP; one with `missing` ranges announces them and has none."""
    count = sip.missing or len(sip.sonar)
    readings = (
        pack_integer(sip, "sonar", "B", reading.number) + pack_integer(sip, "sonar", "H", reading.range_raw)
        for reading in sip.sonar
    )
    length = pack_integer(sip, "sonar (its length)", "B", count)
    return pack(sip, SIP_START) + length + b"".join(readings) + pack(sip, SIP_TAIL) + sip.extra


class Decoder(Generic[F]):
    """Turns the bytes of one direction into commands or packets.

    It decodes bodies by `decode_command` for the bytes to the robot, by `decode_packet` for those from it.
    """

    def __init__(self, decode: Callable[[bytes], F]) -> None:
        self.frames = 0
        self.bad = 0
        """Frames decoded, and headers whose frame has an impossible length or a wrong checksum."""
        self._decode = decode
        self._pending = bytearray()
        """Bytes from the first incomplete frame on."""

    @property
    def pending(self) -> int:
        """Number of bytes kept of an incomplete frame; never as many as a whole frame has."""
        return len(self._pending)

    def feed(self, data: bytes) -> list[F]:
        """Return what `data` completes, in order; how the bytes are split makes no difference."""
        self._pending += data
        return self._take()

    def skip(self) -> list[F]:
        """Give up the incomplete frame, as its rest does not come; return the frames inside its bytes."""
        found: list[F] = []
        while self._pending:
            self.bad += len(self._pending) > 1
            del self._pending[0]
            found += self._take()
        return found

    def _take(self) -> list[F]:
        """Return the frames in the bytes kept, count corrupt ones, and keep from the first incomplete one on."""
        found: list[F] = []
        data, at = bytes(self._pending), 0
        while (start := data.find(HEADER, at)) >= 0 and start + 2 < len(data):
            length = data[start + 2]
            end = start + 3 + length
            if length >= _LENGTH_MIN and end > len(data):
                break
            body = data[start + 3 : end - 2]
            if length < _LENGTH_MIN or checksum(body) != int.from_bytes(data[end - 2 : end], "big"):
                self.bad += 1
                at = start + 1
                continue
            found.append(self._decode(body))
            self.frames += 1
            at = end
        if start < 0:
            start = max(at, len(data) - data.endswith(HEADER[:1]))
        del self._pending[:start]
        return found
