"""Frames to bytes and back: byte stuffing (COBS), checksum and field layout; without I/O.

The decoder is total: for any bytes it raises no exception, keeps at most one incomplete frame, resynchronises at the
next zero byte, and counts the frames it could not decode.
"""

from __future__ import annotations

import binascii
import struct
from collections import deque
from collections.abc import Callable
from types import MappingProxyType
from typing import Literal, NamedTuple

from cobs import cobs

from drivers.denning.frames import (
    MASKS_MAX,
    NO_ECHO,
    TENTHS_MIN,
    WINDOW_MAX,
    WINDOW_MIN,
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
    Nak,
    NakCode,
    Odom,
    Pattern,
    Release,
    Scan,
)
from drivers.denning.servo_codec import decode_echo3_tail, decode_scan_tail, encode_servo_tail

FRAME_MAX = 128
"""Longest frame before stuffing, checksum included, bytes."""
_STUFFED_MAX = FRAME_MAX + 1
"""COBS adds one byte to anything up to 254 long."""
_OVERHEAD = 4
"""Type, sequence number and checksum."""
_NAME_BYTES = 16
_MASK_BYTES = 3
_IDENT_LONGER = 2
"""The version whose IDENT has a range unit and capabilities."""
_REJECTED_MAX = 64
"""Rejected frames kept if they are not taken."""

_RANGES = MappingProxyType(
    {
        "B": (0, 0xFF),
        "H": (0, 0xFFFF),
        "I": (0, 0xFFFF_FFFF),
        "h": (-0x8000, 0x7FFF),
        "i": (-0x8000_0000, 0x7FFF_FFFF),
    }
)


class _Layout(NamedTuple):
    """The byte layout of one type of frame: its fixed fields, which precede those of variable length."""

    type: int
    make: Callable[..., Frame]
    codes: str
    fields: tuple[str, ...]
    fixed: struct.Struct
    """Packs the fixed fields."""


def _layout(kind: int, make: Callable[..., Frame], codes: str, fields: tuple[str, ...]) -> _Layout:
    return _Layout(kind, make, codes, fields, struct.Struct("<" + codes))


_HOST = (
    _layout(0x01, Hello, "B", ("version",)),
    _layout(0x02, Pattern, "", ()),
    _layout(0x03, Listen, "", ()),
    _layout(0x04, Scan, "", ()),
    _layout(0x10, Drive, "hh", ("v_mm_s", "w_mrad_s")),
    _layout(0x11, Halt, "", ()),
    _layout(0x12, Release, "", ()),
)
_ROBOT = (
    _layout(
        0x81,
        Ident,
        "BBHHHI",
        ("version", "sensors", "ring_radius_mm", "deadman_ms", "odometry_period_ms", "boot_id"),
    ),
    _layout(0x82, Ack, "B", ("of",)),
    _layout(0x83, Nak, "BB", ("of", "code")),
    _layout(
        0x90,
        Odom,
        "IiiiihhBB",
        (
            "t_us",
            "x_0p1mm",
            "y_0p1mm",
            "heading_1em4rad",
            "ring_yaw_1em4rad",
            "v_mm_s",
            "w_mrad_s",
            "flags",
            "last_drive_seq",
        ),
    ),
    _layout(0x91, Echo, "IB", ("t_us", "step")),
    _layout(0x92, Echo2, "IB", ("t_us", "step")),
    _layout(0x93, Echo3, "IB", ("t_us", "step")),
)
_BY_CLASS = MappingProxyType({layout.make: layout for layout in (*_HOST, *_ROBOT)})
_BY_TYPE = MappingProxyType(
    {
        "host": {layout.type: layout for layout in _HOST},
        "robot": {layout.type: layout for layout in _ROBOT},
    }
)


def crc(data: bytes) -> int:
    """Return the CRC-16/CCITT-FALSE of `data`."""
    return binascii.crc_hqx(data, 0xFFFF)


def encode(frame: Frame, seq: int | None = None) -> bytes:
    """Return the bytes of a frame, its closing zero included.

    The number `seq` replaces the frame's own.

    Raises
    ------
    ValueError
        A field does not fit; the message names the field, its value and its range.
    """
    layout = _BY_CLASS[type(frame)]
    body = bytes((layout.type, _checked(frame, "seq", frame.seq if seq is None else seq, 0, 0xFF)))
    values = [getattr(frame, field) for field in layout.fields]
    for field, code, value in zip(layout.fields, layout.codes, values, strict=True):
        low, high = _RANGES[code]
        if type(value) is not int or not low <= value <= high:
            _checked(frame, field, value, low, high)
    body += layout.fixed.pack(*values) + _encode_tail(frame)
    stuffed: bytes = cobs.encode(body + struct.pack("<H", crc(body)))
    return stuffed + b"\0"


def _checked(frame: Frame, field: str, value: int, low: int, high: int) -> int:
    if not isinstance(value, int) or not low <= value <= high:
        raise ValueError(f"{type(frame).__name__}.{field} is {value!r}: it must be a whole number, {low} to {high}")
    return value


def _mask_bytes(frame: Frame, field: str, mask: int) -> bytes:
    return _checked(frame, field, mask, 0, 0xFF_FFFF).to_bytes(_MASK_BYTES, "little")


def _masks_bytes(frame: Pattern | Listen) -> bytes:
    return b"".join(_mask_bytes(frame, f"masks[{k}]", mask) for k, mask in enumerate(frame.masks))


def _masks(data: bytes) -> tuple[int, ...]:
    return tuple(int.from_bytes(data[k : k + _MASK_BYTES], "little") for k in range(0, len(data), _MASK_BYTES))


def _encode_tail(frame: Frame) -> bytes:
    """Return the bytes after the fixed fields, for types of variable length."""
    match frame:
        case Pattern():
            head = (
                _checked(frame, "masks (their number)", len(frame.masks), 0, MASKS_MAX),
                _checked(frame, "step_period_ms", frame.step_period_ms, *_RANGES["H"]),
                _checked(frame, "window", frame.window, WINDOW_MIN, WINDOW_MAX),
            )
            return struct.pack("<BHB", *head) + _masks_bytes(frame)
        case Listen():
            return bytes((_checked(frame, "masks (their number)", len(frame.masks), 0, MASKS_MAX),)) + _masks_bytes(
                frame
            )
        case Ident():
            name = frame.name.encode(errors="replace")
            if len(name) > _NAME_BYTES or b"\0" in name:
                raise ValueError(f"Ident.name is {frame.name!r}: it must be 0 to {_NAME_BYTES} bytes without a zero")
            name = name.ljust(_NAME_BYTES, b"\0")
            if frame.version != _IDENT_LONGER:
                return name
            unit_um = _checked(frame, "range_unit_um", frame.range_unit_um, 1, 0xFFFF)
            return name + struct.pack("<HB", unit_um, _checked(frame, "capabilities", frame.capabilities, 0, 0xFF))
        case Echo():
            mask = _mask_bytes(frame, "mask", frame.mask)
            fired = frame.mask.bit_count()
            if len(frame.tenths_ft) != fired:
                raise ValueError(f"Echo.tenths_ft has {len(frame.tenths_ft)} values: its mask asks for {fired}")
            for k, tenths in enumerate(frame.tenths_ft):
                if tenths != 0:
                    _checked(frame, f"tenths_ft[{k}]", tenths, TENTHS_MIN, NO_ECHO)
            return mask + bytes(frame.tenths_ft)
        case Echo2():
            masks = _mask_bytes(frame, "fired", frame.fired) + _mask_bytes(frame, "heard", frame.heard)
            if frame.fired & frame.heard:
                raise ValueError(
                    f"Echo2.heard is {frame.heard:#x}: a sensor of fired ({frame.fired:#x}) cannot listen"
                )
            sensors = (frame.fired | frame.heard).bit_count()
            if len(frame.counts) != sensors:
                raise ValueError(f"Echo2.counts has {len(frame.counts)} values: its pair of masks asks for {sensors}")
            for k, count in enumerate(frame.counts):
                _checked(frame, f"counts[{k}]", count, *_RANGES["H"])
            return masks + struct.pack(f"<{sensors}H", *frame.counts)
        case Scan() | Echo3():
            return encode_servo_tail(frame)
        case _:
            return b""


def _decode_tail(layout: _Layout, version: int, tail: bytes) -> tuple[object, ...] | NakCode:
    """Return the fields after the fixed ones, or the reason why they are invalid; `version` is that of an IDENT."""
    if layout.make is Pattern:
        if len(tail) < 4 or len(tail) != 4 + _MASK_BYTES * tail[0]:
            return NakCode.WRONG_LENGTH
        count, step_period_ms, window = struct.unpack_from("<BHB", tail)
        if count > MASKS_MAX or window < WINDOW_MIN:
            return NakCode.VALUE_OUT_OF_RANGE
        return step_period_ms, window, _masks(tail[4:])
    if layout.make is Listen:
        if not tail or len(tail) != 1 + _MASK_BYTES * tail[0]:
            return NakCode.WRONG_LENGTH
        return (_masks(tail[1:]),) if tail[0] <= MASKS_MAX else NakCode.VALUE_OUT_OF_RANGE
    if layout.make is Ident:
        return _decode_ident_tail(version, tail)
    if layout.make is Echo:
        mask = int.from_bytes(tail[:_MASK_BYTES], "little")
        if len(tail) < _MASK_BYTES or len(tail) != _MASK_BYTES + mask.bit_count():
            return NakCode.WRONG_LENGTH
        tenths = tuple(tail[_MASK_BYTES:])
        return NakCode.VALUE_OUT_OF_RANGE if any(0 < t < TENTHS_MIN for t in tenths) else (mask, tenths)
    if decode := _TAILS.get(layout.make):
        return decode(tail)
    return NakCode.WRONG_LENGTH if tail else ()


def _decode_echo2_tail(tail: bytes) -> tuple[object, ...] | NakCode:
    """Return the fields of an ECHO2 after its fixed ones: fired, heard, counts; or what is wrong with them."""
    if len(tail) < 2 * _MASK_BYTES:
        return NakCode.WRONG_LENGTH
    fired, heard = _masks(tail[: 2 * _MASK_BYTES])
    if len(tail) != 2 * (_MASK_BYTES + fired.bit_count() + heard.bit_count()):
        return NakCode.WRONG_LENGTH
    counts = struct.unpack_from(f"<{fired.bit_count() + heard.bit_count()}H", tail, 2 * _MASK_BYTES)
    return NakCode.VALUE_OUT_OF_RANGE if fired & heard else (fired, heard, counts)


_TAILS = MappingProxyType[Callable[..., Frame], Callable[[bytes], tuple[object, ...] | NakCode]](
    {Echo2: _decode_echo2_tail, Echo3: decode_echo3_tail, Scan: decode_scan_tail}
)


def _decode_ident_tail(version: int, tail: bytes) -> tuple[object, ...] | NakCode:
    """Return the fields of an IDENT after its fixed ones: name, unit, abilities; or what is wrong with them."""
    if len(tail) != _NAME_BYTES + (3 if version == _IDENT_LONGER else 0):
        return NakCode.WRONG_LENGTH
    try:
        name = tail[:_NAME_BYTES].rstrip(b"\0").decode()
    except UnicodeDecodeError:
        return NakCode.VALUE_OUT_OF_RANGE
    more = struct.unpack("<HB", tail[_NAME_BYTES:]) if version == _IDENT_LONGER else (0, 0)
    return (
        NakCode.VALUE_OUT_OF_RANGE if "\0" in name or (version == _IDENT_LONGER and more[0] == 0) else (name, *more)
    )


class Decoder:
    """Turns the bytes of one direction into frames.

    `direction` is the side that sends. `midway`: the line may be in use already, so that the first bytes are the end
    of a frame: up to the first 0x00 they are dropped without being counted.
    """

    def __init__(self, direction: Literal["host", "robot"], *, midway: bool = False) -> None:
        self.frames = 0
        """Frames decoded."""
        self.bad = 0
        """Frames dropped: invalid stuffing, length, checksum or content."""
        self.lost = 0
        """Frames missing by the sender's sequence numbers, among them those dropped for stuffing, length or
        checksum."""
        self._layouts = _BY_TYPE[direction]
        self._pending = bytearray()
        """The stuffed bytes of the frame that is incomplete."""
        self._skipping = False
        """Whether that frame is too long, so that its rest is dropped."""
        self._midway = midway
        self._seq: int | None = None
        """Number of the last frame; None before the first."""
        self._rejected: deque[tuple[int, NakCode]] = deque(maxlen=_REJECTED_MAX)

    @property
    def rejected(self) -> list[tuple[int, NakCode]]:
        """Frames with a valid checksum and invalid content: sequence number and reason, the newest 64."""
        return list(self._rejected)

    def take_rejected(self) -> list[tuple[int, NakCode]]:
        """Return `rejected`, and clear it."""
        taken = self.rejected
        self._rejected.clear()
        return taken

    @property
    def pending(self) -> int:
        """Number of bytes kept of an incomplete frame; never more than one frame."""
        return len(self._pending)

    def feed(self, data: bytes) -> list[Frame]:
        """Return the frames that `data` completes, in order; how the bytes are split makes no difference."""
        found: list[Frame] = []
        start = 0
        while (end := data.find(b"\0", start)) >= 0:
            self._gather(data, start, end)
            start = end + 1
            if self._pending:
                frame = self._decode(bytes(self._pending))
                if frame is not None:
                    found.append(frame)
            self._pending.clear()
            self._skipping = self._midway = False
        self._gather(data, start, len(data))
        return found

    def _gather(self, data: bytes, start: int, end: int) -> None:
        """Keep a piece of a frame; count one that is too long as bad, once, and drop it to its end."""
        if self._skipping:
            return
        if len(self._pending) + end - start > _STUFFED_MAX:
            self.bad += 1
            self._skipping = True
            self._pending.clear()
            return
        self._pending += data[start:end]

    def _decode(self, stuffed: bytes) -> Frame | None:
        """Return the frame of stuffed bytes; None if it is invalid, which is counted."""
        try:
            body = cobs.decode(stuffed)
        except cobs.DecodeError:
            self.bad += not self._midway
            return None
        if len(body) < _OVERHEAD or crc(body[:-2]) != int.from_bytes(body[-2:], "little"):
            self.bad += not self._midway
            return None
        self._count_gap(body[1])
        frame = self._parse(body[0], body[1], body[2:-2])
        if isinstance(frame, NakCode):
            self.bad += 1
            self._rejected.append((body[1], frame))
            return None
        self.frames += 1
        return frame

    def _count_gap(self, seq: int) -> None:
        """Count the frames that are missing before this number."""
        if self._seq is not None and seq != self._seq:
            self.lost += (seq - self._seq - 1) % 256
        self._seq = seq

    def _parse(self, kind: int, seq: int, payload: bytes) -> Frame | NakCode:
        """Return the frame of a payload with a valid checksum, or what is wrong with it."""
        layout = self._layouts.get(kind)
        if layout is None:
            return NakCode.UNKNOWN_TYPE
        if len(payload) < layout.fixed.size:
            return NakCode.WRONG_LENGTH
        tail = _decode_tail(layout, payload[0] if payload else 0, payload[layout.fixed.size :])
        if isinstance(tail, NakCode):
            return tail
        return layout.make(seq, *layout.fixed.unpack_from(payload), *tail)
