"""The robot's transmitter: bytes leave one by one at the line's speed, from a queue that has an end.

A pty takes bytes as fast as they are written; a real line at 115200 baud takes 87 µs for each. All arithmetic is in
whole microseconds and whole bytes, so that it does not matter how often anybody looks.
"""

from __future__ import annotations

BITS_PER_BYTE = 10
"""8N1: a start bit, eight data bits, a stop bit."""
QUEUE_MAX = 1024
"""Bytes waiting at most; a frame that does not fit is dropped whole, and its sequence number tells."""
_MICRO = 1_000_000


class Uart:
    """A paced transmit queue.

    Attributes
    ----------
    dropped
        Frames that did not fit.
    """

    def __init__(self, baud: int) -> None:
        self._baud = baud
        self._queue = bytearray()
        self._start_us = 0
        self._left = 0
        self.dropped = 0

    def send(self, frame: bytes, now_us: int) -> None:
        """Queue a whole frame at `now_us`; what has left by then must have been taken."""
        if len(self._queue) + len(frame) > QUEUE_MAX:
            self.dropped += 1
            return
        if not self._queue:
            # The line may still be busy with the last byte's end.
            self._start_us = max(now_us, self._leaves_us(self._left))
            self._left = 0
        self._queue += frame

    def take(self, now_us: int) -> bytes:
        """Return the bytes that have left completely by `now_us`."""
        if not self._queue:
            return b""
        done = max(0, now_us - self._start_us) * self._baud // (BITS_PER_BYTE * _MICRO)
        count = min(len(self._queue), done - self._left)
        if count <= 0:
            return b""
        taken = bytes(self._queue[:count])
        del self._queue[:count]
        self._left += count
        return taken

    def clear(self) -> None:
        """Forget what has not left."""
        self._queue.clear()

    @property
    def empty_us(self) -> int | None:
        """When the last byte in the queue will have left; None where there is none."""
        return self._leaves_us(self._left + len(self._queue)) if self._queue else None

    def _leaves_us(self, count: int) -> int:
        return self._start_us - (-count * BITS_PER_BYTE * _MICRO // self._baud)
