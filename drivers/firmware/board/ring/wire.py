"""Frames to bytes and back: byte stuffing (COBS), checksum, sequence numbers. Buffers are allocated once."""

import micropython

FRAME_MAX = 128
"""Longest frame before stuffing, checksum included, bytes."""


@micropython.native
def crc(data: bytearray, count: int) -> int:
    """Return the CRC-16/CCITT-FALSE of the first `count` bytes."""
    value = 0xFFFF
    for i in range(count):
        x = (value >> 8) ^ data[i]
        x ^= x >> 4
        value = ((value << 8) ^ (x << 12) ^ (x << 5) ^ x) & 0xFFFF
    return value


@micropython.native
def unstuff(data: bytearray, count: int) -> int:
    """Undo the byte stuffing of the first `count` bytes in place; return the length, 0 if it is invalid."""
    read = write = 0
    while read < count:
        code = data[read]
        read += 1
        if code == 0 or read + code - 1 > count:
            return 0
        for _ in range(code - 1):
            data[write] = data[read]
            write += 1
            read += 1
        if code < 0xFF and read < count:
            data[write] = 0
            write += 1
    return write


@micropython.native
def stuff(data: bytearray, count: int, out: bytearray) -> int:
    """Write the first `count` bytes of `data`, stuffed and with a closing zero, to `out`; return the length."""
    mark, write = 0, 1
    for i in range(count):
        byte = data[i]
        if byte:
            out[write] = byte
        else:
            out[mark] = write - mark
            mark = write
        write += 1
    out[mark] = write - mark
    out[write] = 0
    return write + 1


class Decoder:
    """Collects the bytes of one frame at a time.

    Attributes
    ----------
    frame
        The last whole frame: type, sequence number, payload.
    length
        Its length without the checksum.
    pending
        Bytes received of the next one, in `frame`.
    bad
        Frames dropped.
    """

    def __init__(self) -> None:
        self.frame = bytearray(FRAME_MAX + 1)
        self.length = 0
        self.pending = 0
        self.bad = 0
        self._skipping = False

    def feed(self, byte: int) -> bool:
        """Take a byte; return True if it ends a valid frame, which stays until the next call."""
        if byte:
            if self.pending <= FRAME_MAX:
                self.frame[self.pending] = byte
                self.pending += 1
            else:
                self._skipping = True
            return False
        count, skipping = self.pending, self._skipping
        self.pending, self._skipping = 0, False
        if count == 0:
            return False
        if not skipping:
            count = unstuff(self.frame, count)
            if 4 <= count <= FRAME_MAX:
                self.length = count - 2
                if crc(self.frame, count - 2) == self.frame[count - 2] | self.frame[count - 1] << 8:
                    return True
        self.bad += 1
        return False


class Encoder:
    """Sends frames on a line, which has a method `write` for a buffer and drops what does not fit.

    Write the payload into `frame` from index 2 on, then call `send`.
    """

    def __init__(self, line) -> None:
        self.frame = bytearray(FRAME_MAX)
        self._out = bytearray(FRAME_MAX + 2)
        self._view = memoryview(self._out)
        self._line = line
        self._seq = 0

    def send(self, kind: int, payload: int) -> None:
        """Send a frame whose payload has that many bytes; its number counts as used even if it is lost."""
        frame, count = self.frame, payload + 2
        frame[0] = kind
        frame[1] = self._seq
        self._seq = (self._seq + 1) & 0xFF
        checksum = crc(frame, count)
        frame[count] = checksum & 0xFF
        frame[count + 1] = checksum >> 8
        self._line.write(self._view[: stuff(frame, count + 2, self._out)])
