"""The robot's transmitter: bytes leave one by one at the line's speed, from a queue of limited length.

A pty takes bytes as fast as they are written; a real line at 115200 baud takes 87 µs for each. All arithmetic is in
whole microseconds and whole bytes, so that it makes no difference how often `take` is called.
"""

from __future__ import annotations

BITS_PER_BYTE = 10
"""8N1: a start bit, eight data bits, a stop bit."""
QUEUE_MAX = 1024
"""Longest queue, bytes; a frame that does not fit is dropped whole, and the host sees a gap in the numbers."""
_US_PER_S = 1_000_000


class Uart:
    """A transmit queue that empties at the line's speed.

    Attributes
    ----------
    dropped
        Number of frames that did not fit.
    """

    def __init__(self, baud: int) -> None:
        self._baud = baud
        self._queue = bytearray()
        """Bytes that have not left completely."""
        self._start_us = 0
        """Since then bytes leave without a pause at this speed."""
        self._left_bytes = 0
        """So many have left since then."""
        self.dropped = 0

    def send(self, frame: bytes, now_us: int) -> None:
        """Queue a whole frame at `now_us`; call `take` before, so that the queue holds only what has not left."""
        if len(self._queue) + len(frame) > QUEUE_MAX:
            self.dropped += 1
            return
        if not self._queue:
            # The last byte may not have left completely.
            self._start_us = max(now_us, self._leaves_us(self._left_bytes))
            self._left_bytes = 0
        self._queue += frame

    def take(self, now_us: int) -> bytes:
        """Return the bytes that have left completely by `now_us`, and remove them."""
        if not self._queue:
            return b""
        done = max(0, now_us - self._start_us) * self._baud // (BITS_PER_BYTE * _US_PER_S)
        count = min(len(self._queue), done - self._left_bytes)
        if count <= 0:
            return b""
        taken = bytes(self._queue[:count])
        del self._queue[:count]
        self._left_bytes += count
        return taken

    def set_baud(self, baud: int, now_us: int) -> None:
        """Change the speed at `now_us`, from the byte on that is being sent; call `take` before."""
        self._start_us = max(now_us, self._leaves_us(self._left_bytes))
        self._left_bytes = 0
        self._baud = baud

    def clear(self) -> None:
        """Drop the bytes that have not left."""
        self._queue.clear()

    @property
    def empty_us(self) -> int | None:
        """When the last byte in the queue will have left, µs; None if the queue is empty."""
        return self._leaves_us(self._left_bytes + len(self._queue)) if self._queue else None

    def _leaves_us(self, count: int) -> int:
        """Return when so many bytes since `_start_us` will have left, µs."""
        return self._start_us - (-count * BITS_PER_BYTE * _US_PER_S // self._baud)
