"""The board's time: its microsecond counter, and the protocol's, which counts from boot and wraps at 2³²."""

from time import sleep_us, ticks_add, ticks_diff, ticks_us

from micropython import const

__all__ = ("Clock", "sleep_us", "ticks_add", "ticks_diff", "ticks_us")

_SECOND_US = const(1_000_000)


class Clock:
    """Extends the counter of `ticks_us`, which wraps after minutes; call `poll` more often than that."""

    def __init__(self) -> None:
        self.ticks = ticks_us()
        self._s = 0
        self._us = 0

    def poll(self) -> int:
        """Return the counter now."""
        now = ticks_us()
        self._us += ticks_diff(now, self.ticks)
        self.ticks = now
        if self._us >= _SECOND_US:
            self._s += self._us // _SECOND_US
            self._us %= _SECOND_US
        return now

    def t_us(self, ticks: int) -> int:
        """Return the protocol's time at a reading of the counter, at most minutes from the last `poll`."""
        # Large integers only here: on a board, numbers from 2³⁰ on are allocated.
        return (self._s * _SECOND_US + self._us + ticks_diff(ticks, self.ticks)) & 0xFFFFFFFF
