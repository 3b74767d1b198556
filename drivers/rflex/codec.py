"""Frames of the rFLEX controller to bytes and back; without I/O.

A frame is ESC STX, port, packet number, opcode, length, data, the exclusive-or of all these, ESC ETX. Whether a
controller escapes an ESC among them is not settled: some clients send and read by length, others read pairs. So the
decoder reads by length, and a frame that this does not fit once more with pairs removed. It is total: for any bytes
it raises no exception, keeps at most one incomplete frame, and looks for the next header inside a wrong frame.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final, TypeAlias

HEADER: Final = b"\x1b\x02"
TRAILER: Final = b"\x1b\x03"
FRAME_MAX: Final = 9 + 0xFF
"""Longest frame without escapes, bytes."""
ESCAPED_MAX: Final = 2 * FRAME_MAX
"""Longest frame with escapes that the decoder waits for, bytes."""
_ESC: Final = 0x1B

SYS, MOTOR, JOYSTICK, SONAR, DIO = 1, 2, 3, 4, 5
"""Ports."""
SYS_STATUS: Final = 1
MOTOR_SET_DIR, MOTOR_SET_POS, MOTOR_DEFAULTS, MOTOR_BRAKE_SET, MOTOR_BRAKE_RELEASE = 7, 8, 10, 11, 12
MOTOR_REPORT, MOTOR_REPORT_REQUEST = 33, 34
SONAR_RUN, SONAR_REPORT = 0, 2
DIO_REQUEST, DIO_REPORT = 0, 1
TRANSLATION, ROTATION = 0, 1
"""Axes."""
NO_ECHO: Final = 32766
"""The range of a sonar that heard nothing."""

_AXIS = struct.Struct(">IIBiiII")
_SET_DIR = struct.Struct(">BIIIB")
_SET_POS = struct.Struct(">BIIIi")
_SONAR_RUN = struct.Struct(">IIIB")
_STATUS = struct.Struct(">IIB")
_DIO = struct.Struct(">IBH")
_READING = struct.Struct(">BH")
_TWO = struct.Struct(">II")


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame: a command, or a report of a kind or length that is not known."""

    port: int
    opcode: int
    data: bytes = b""
    number: int = 0


@dataclass(frozen=True, slots=True)
class AxisReport:
    """The state of an axis: counts, and counts per second."""

    t_us: int
    axis: int
    position: int
    velocity: int
    acceleration: int = 0
    torque: int = 0
    returned: int = 0


@dataclass(frozen=True, slots=True)
class SonarReport:
    """Ranges of sonars that fired together, as pairs of id and range."""

    t_us: int
    readings: tuple[tuple[int, int], ...]
    returned: int = 0


@dataclass(frozen=True, slots=True)
class Status:
    """Voltage, 0.01 V, and whether the brake is on (not 0)."""

    t_us: int
    voltage: int
    brake: int


@dataclass(frozen=True, slots=True)
class Input:
    """The bits of a digital input."""

    t_us: int
    address: int
    bits: int


Report: TypeAlias = AxisReport | SonarReport | Status | Input | Frame


def checksum(body: bytes | bytearray) -> int:
    """Return the exclusive-or of all bytes."""
    total = 0
    for byte in body:
        total ^= byte
    return total


def encode(frame: Frame) -> bytes:
    """Return the bytes of a frame.

    Raises
    ------
    ValueError
        The data is longer than a frame holds.
    """
    if len(frame.data) > 0xFF:
        raise ValueError(f"{len(frame.data)} bytes of data: a frame holds at most 255")
    body = bytes((frame.port, frame.number, frame.opcode, len(frame.data))) + frame.data
    return HEADER + body + bytes((checksum(body),)) + TRAILER


def set_direction(axis: int, speed: int, acceleration: int, torque: int) -> Frame:
    """Return the command of a speed, counts per second and per second²; its sign is the direction."""
    return Frame(MOTOR, MOTOR_SET_DIR, _SET_DIR.pack(axis, abs(speed), acceleration, torque, speed >= 0))


def direction_of(frame: Frame) -> tuple[int, int, int]:
    """Return axis, signed speed and acceleration of a MOTOR_SET_DIR of the right length."""
    axis, speed, acceleration, _, positive = _SET_DIR.unpack(frame.data)
    return axis, speed if positive else -speed, acceleration


def position_of(frame: Frame) -> tuple[int, int]:
    """Return axis and position of a MOTOR_SET_POS of the right length."""
    axis, *_, position = _SET_POS.unpack(frame.data)
    return axis, position


def report_request(period_us: int, mask: int) -> Frame:
    """Return the request for reports of the axes in `mask`; 0 for both ends them."""
    return Frame(MOTOR, MOTOR_REPORT_REQUEST, _TWO.pack(period_us, mask))


def input_request(period_us: int) -> Frame:
    """Return the request for reports of the digital inputs; 0 ends them."""
    return Frame(DIO, DIO_REQUEST, period_us.to_bytes(4, "big"), number=0 if period_us else 4)


def sonar_run(echo_us: int, ping_us: int, *, on: bool = True) -> Frame:
    """Return the command that starts the sonars with these delays, or ends them."""
    return Frame(SONAR, SONAR_RUN, _SONAR_RUN.pack(echo_us, ping_us, 0, 2 if on else 0), number=4)


def sonar_delays_of(frame: Frame) -> tuple[int, bool]:
    """Return echo and ping delay together, µs, and whether sonars run, of a SONAR_RUN of the right length."""
    echo_us, ping_us, _, mode = _SONAR_RUN.unpack(frame.data)
    return echo_us + ping_us, mode == 2


BRAKE_SET: Final = Frame(MOTOR, MOTOR_BRAKE_SET)
BRAKE_RELEASE: Final = Frame(MOTOR, MOTOR_BRAKE_RELEASE)
SET_DEFAULTS: Final = Frame(MOTOR, MOTOR_DEFAULTS)
STATUS_REQUEST: Final = Frame(SYS, SYS_STATUS)


def frame_of(report: Report, number: int = 0) -> Frame:
    """Return the frame of a report."""
    match report:
        case AxisReport():
            fields = (report.axis, report.position, report.velocity, report.acceleration, report.torque)
            return Frame(MOTOR, MOTOR_REPORT, _AXIS.pack(report.returned, report.t_us, *fields), number)
        case SonarReport():
            readings = b"".join(_READING.pack(*reading) for reading in report.readings)
            return Frame(SONAR, SONAR_REPORT, _TWO.pack(report.returned, report.t_us) + readings, number)
        case Status():
            return Frame(SYS, SYS_STATUS, _STATUS.pack(report.t_us, report.voltage, report.brake), number)
        case Input():
            return Frame(DIO, DIO_REPORT, _DIO.pack(report.t_us, report.address, report.bits), number)
        case Frame():
            return report


def report_of(frame: Frame) -> Report:
    """Return the report of a frame from the controller; the frame itself if its kind or length is not known."""
    data = frame.data
    match frame.port, frame.opcode:
        case 2, 33 if len(data) == _AXIS.size:
            returned, t_us, axis, position, velocity, acceleration, torque = _AXIS.unpack(data)
            return AxisReport(t_us, axis, position, velocity, acceleration, torque, returned)
        case 4, 2 if len(data) >= _TWO.size and (len(data) - _TWO.size) % _READING.size == 0:
            returned, t_us = _TWO.unpack(data[: _TWO.size])
            return SonarReport(t_us, tuple(_READING.iter_unpack(data[_TWO.size :])), returned)
        case 1, 1 if len(data) >= _STATUS.size:
            return Status(*_STATUS.unpack(data[: _STATUS.size]))
        case 5, 1 if len(data) == _DIO.size:
            return Input(*_DIO.unpack(data))
        case 5, 1 if len(data) == _DIO.size - 1:
            return Input(int.from_bytes(data[:4], "big"), data[4], data[5])
        case _:
            return frame


_SEVEN_BITS: Final = 0x7F
_SEVEN_BIT_FRAMES: Final = 50
"""So many frames without an eighth bit are no chance: the checksum of each has one in two."""


class Decoder:
    """Turns the bytes of one direction into frames.

    Attributes
    ----------
    frames, bad
        Frames decoded, and headers that no valid frame follows.
    has_eighth_bit
        Whether any byte had its eighth bit set.
    """

    def __init__(self) -> None:
        self.frames = self.bad = 0
        self._pending = b""
        self.has_eighth_bit = False

    @property
    def lacks_eighth_bits(self) -> bool:
        """Whether the line passes on seven bits of a byte: the checksum, an XOR, is right then, and no value is."""
        return not self.has_eighth_bit and self.frames >= _SEVEN_BIT_FRAMES

    @property
    def pending(self) -> int:
        """Number of bytes kept of an incomplete frame; at most `ESCAPED_MAX`."""
        return len(self._pending)

    def feed(self, data: bytes) -> list[Frame]:
        """Return what `data` completes, in order; how the bytes are split makes no difference."""
        self.has_eighth_bit = self.has_eighth_bit or max(data, default=0) > _SEVEN_BITS
        data, at, found = self._pending + data, 0, list[Frame]()
        while (start := data.find(HEADER, at)) >= 0:
            end = start + 9 + data[start + 5] if start + 5 < len(data) else len(data) + 1
            if end > len(data):
                break
            body = data[start + 2 : end - 3]
            if data[end - 2 : end] != TRAILER or checksum(body) != data[end - 3]:
                end, body = _unescaped(data, start)
                if end > len(data):
                    break
            if body:
                found.append(Frame(body[0], body[2], body[4:], body[1]))
                self.frames += 1
            else:
                self.bad += 1
            at = end
        if start < 0:
            start = max(at, len(data) - data.endswith(HEADER[:1]))
        self._pending = data[start:]
        return found


def _unescaped(data: bytes, start: int) -> tuple[int, bytes]:
    """Return end and body of a frame with escaped pairs; past the end of `data` if it may still be completed.

    The body is empty, and the end that of the header's first byte, if there is no such frame.
    """
    body, at, wrong = bytearray(), start + 2, (start + 1, b"")
    while at - start <= ESCAPED_MAX:
        if len(body) >= 4 and len(body) > body[3] + 5:
            return wrong
        pair = data[at : at + 2]
        if not pair or pair == HEADER[:1]:
            return len(data) + 1, b""
        if pair[0] != _ESC:
            body.append(pair[0])
            at += 1
        elif pair[1] == 0:
            if at + 2 >= len(data):
                return len(data) + 1, b""
            body += bytes((_ESC, data[at + 2]))
            at += 3
        elif pair[1] == 1:
            at += 2
        else:
            whole = pair == TRAILER and len(body) >= 5 and len(body) == body[3] + 5
            return (at + 2, bytes(body[:-1])) if whole and checksum(body) == 0 else wrong
    return wrong
