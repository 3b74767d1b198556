"""The robot: obeys the host's frames, reports odometry, and lets the ring fire."""

import gc
from struct import pack_into, unpack_from

from micropython import const

from ring.base import Base
from ring.clock import Clock, ticks_add, ticks_diff
from ring.firing import RANGE_UNIT_UM, Firing
from ring.wire import Decoder, Encoder

_HELLO = const(0x01)
_PATTERN = const(0x02)
_LISTEN = const(0x03)
_SCAN = const(0x04)
_DRIVE = const(0x10)
_HALT = const(0x11)
_RELEASE = const(0x12)
_IDENT = const(0x81)
_ACK = const(0x82)
_NAK = const(0x83)
_ODOM = const(0x90)
_UNKNOWN = const(1)
_LENGTH = const(2)
_VALUE = const(3)
_IS_LATCHED = const(4)
_VERSION = const(2)
_ODOMETRY_MS = const(20)
_COLLECT_US = const(1_000_000)
_COLLECT_TIME_US = const(10_000)
_INTERRUPT = b"\r\x03"
"""How mpremote asks for the console."""
_SILENT_US = const(200_000)
_READ_MAX = const(64)
"""Bytes read before anything else is done."""


class ConsoleRequested(Exception):  # noqa: N818 - no error
    """The host asked for the board's console: the line's bytes are no frame, but mpremote's."""


class Robot:
    """Everything together; call `poll` without end.

    `config` is the module `robot_config`, `boot_id` a random number, another one after each start; `scan` is None
    without servos.
    """

    def __init__(self, config, sensors: tuple, base: Base, line, boot_id: int, scan=None) -> None:
        self.base = base
        self.line = line
        self._config = config
        self._clock = Clock()
        self._decoder = Decoder()
        self._payload = memoryview(self._decoder.frame)
        self._encoder = Encoder(line)
        self._boot_id = boot_id
        self.firing = Firing(sensors, self._clock, self._encoder, scan)
        now = self._clock.ticks
        self._odometry_due = ticks_add(now, 1000 * _ODOMETRY_MS)
        self._collect_due = ticks_add(now, _COLLECT_US)
        self._byte_ticks = now
        self._sensors = len(sensors)

    def poll(self) -> None:
        """Do what is due: frames received, firings, odometry; collect garbage where it delays nothing."""
        now = self._clock.poll()
        self._read(now)
        self.firing.poll()
        if ticks_diff(now, self._odometry_due) >= 0:
            self._odometry_due = ticks_add(self._odometry_due, 1000 * _ODOMETRY_MS)
            if ticks_diff(now, self._odometry_due) >= 0:  # the board was kept busy: no burst
                self._odometry_due = ticks_add(now, 1000 * _ODOMETRY_MS)
            self._report()
        late_us = ticks_diff(now, self._collect_due)
        if late_us >= 0 and (self.firing.idle_us() > _COLLECT_TIME_US or late_us > _COLLECT_US):
            gc.collect()
            self._collect_due = ticks_add(now, _COLLECT_US)

    def _read(self, now: int) -> None:
        """Read at most `_READ_MAX` bytes and obey each whole frame; an interrupt asks for the console."""
        decoder = self._decoder
        for _ in range(_READ_MAX):
            byte = self.line.read()
            if byte < 0:
                break
            self._byte_ticks = now
            if decoder.feed(byte):
                self._obey(decoder.frame[0], decoder.frame[1], self._payload[2 : decoder.length])
        if decoder.pending < 2 or ticks_diff(now, self._byte_ticks) <= _SILENT_US:
            return
        if decoder.frame[: len(_INTERRUPT)] == _INTERRUPT:
            raise ConsoleRequested

    def _obey(self, kind: int, seq: int, payload: memoryview) -> None:
        """Carry out a command and answer ACK or NAK; codes below 0 get no answer."""
        code = self._refusal(kind, seq, payload)
        frame = self._encoder.frame
        frame[2] = seq
        if code > 0:
            frame[3] = code
            self._encoder.send(_NAK, 2)
        elif code == 0:
            self._encoder.send(_ACK, 1)

    def _refusal(self, kind: int, seq: int, payload: memoryview) -> int:
        """Obey a command; return 0, the code of its NAK, or −1 if it is answered otherwise."""
        length = len(payload)
        if kind == _DRIVE:
            if length != 4:
                return _LENGTH
            v_mm_s, w_mrad_s = unpack_from("<hh", payload)
            return -1 if self.base.drive(v_mm_s, w_mrad_s, seq) else _IS_LATCHED
        if kind == _PATTERN:
            return self.firing.set_pattern(payload)
        if kind == _HELLO:
            if length != 1:
                return _LENGTH
            if not 1 <= payload[0] <= _VERSION:
                return _VALUE
            self._identify(payload[0])
            return -1
        if kind == _LISTEN and self.firing.version > 1:
            if length < 1 or length != 1 + 3 * payload[0]:
                return _LENGTH
            return 0 if payload[0] == 0 else _VALUE  # this ring cannot listen
        if kind == _SCAN and self.firing.version > 1 and self.firing.scan is not None:
            return self.firing.scan.set(payload)
        if kind not in (_HALT, _RELEASE):
            return _UNKNOWN
        if length:
            return _LENGTH
        if kind == _HALT:
            self.base.halt()
        else:
            self.base.release()
        return 0

    def _identify(self, version: int) -> None:
        """Answer HELLO with IDENT, and speak this version from now on."""
        config, frame = self._config, self._encoder.frame
        self.firing.version = version
        name = config.NAME.encode()[:16]
        radius, deadman = config.RING_RADIUS_MM, config.DEADMAN_MS
        pack_into("<BBHHHI", frame, 2, version, self._sensors, radius, deadman, _ODOMETRY_MS, self._boot_id)
        for i in range(16):
            frame[14 + i] = name[i] if i < len(name) else 0
        pack_into("<HB", frame, 30, RANGE_UNIT_UM, 0 if self.firing.scan is None else 2)
        self._encoder.send(_IDENT, 28 if version == 1 else 31)

    def _report(self) -> None:
        base = self.base
        frame, t_us, heading = self._encoder.frame, self._clock.t_us(self._clock.poll()), base.heading
        pack_into("<Iiiii", frame, 2, t_us, base.x, base.y, heading, heading)
        pack_into("<hhBB", frame, 22, base.v, base.w, base.flags, base.drive_seq)
        self._encoder.send(_ODOM, 26)
