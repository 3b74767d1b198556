"""Waking on time: sleep until a deadline to the microsecond, or until somebody has news.

asyncio hands its timeouts to epoll in whole milliseconds, rounded up, and the kernel may add its timer slack on top:
a cycle that sleeps that way begins 0.7 ms late at the median. A timerfd is a timer that the loop waits for as for any
other file: it counts nanoseconds and gets no slack. `bench/waking.py` measures it against what else there is.
"""

from __future__ import annotations

import asyncio
import ctypes
import math
import os
import time
from collections.abc import Callable
from typing import Final, Protocol

from runtime.timing.run_clock import run_clock

_COUNT_BYTES: Final = 8
"""What is read from a timerfd: how often it fired."""
_TURNS: Final = 2
"""Turns of the loop until what had arrived is taken in: the first finds it, the second goes on after it."""


class _TimeSpec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


class _TimerSpec(ctypes.Structure):
    _fields_ = (("interval", _TimeSpec), ("value", _TimeSpec))


class Alarm(Protocol):
    """Calls back once, after a while; setting it again forgets the earlier moment."""

    def set(self, left_s: float) -> None:
        """Be due in `left_s`."""

    def close(self) -> None:
        """Never call again."""


class TimerFd:
    """An alarm in the kernel: exact, and Linux only.

    Parameters
    ----------
    ring : callable
        Called in the running loop when the alarm is due.

    Raises
    ------
    OSError
        This system has no such timers.
    """

    def __init__(self, ring: Callable[[], None]) -> None:
        libc = ctypes.CDLL(None, use_errno=True)
        try:
            create, self._settime = libc.timerfd_create, libc.timerfd_settime
        except AttributeError as error:
            raise OSError("this system has no timerfd") from error
        self._ring = ring
        self._loop = asyncio.get_running_loop()
        self._spec = _TimerSpec()
        self._fd: int = create(time.CLOCK_MONOTONIC, os.O_NONBLOCK | os.O_CLOEXEC)
        if self._fd < 0:
            raise OSError(ctypes.get_errno(), "no timer could be made")
        self._loop.add_reader(self._fd, self._due)

    def set(self, left_s: float) -> None:
        """Be due in `left_s`; at once where that is negative."""
        value = self._spec.value
        # Zero would switch it off.
        value.seconds, value.nanoseconds = divmod(max(1, math.ceil(left_s * 1e9)), 1_000_000_000)
        self._settime(self._fd, 0, ctypes.byref(self._spec), None)

    def close(self) -> None:
        """Give the timer back."""
        self._loop.remove_reader(self._fd)
        os.close(self._fd)

    def _due(self) -> None:
        try:
            os.read(self._fd, _COUNT_BYTES)
        except BlockingIOError:  # it was set anew in the same turn of the loop
            return
        self._ring()


class LoopTimer:
    """An alarm by the loop's own timers, to the millisecond: for systems without a timerfd."""

    def __init__(self, ring: Callable[[], None]) -> None:
        self._ring = ring
        self._loop = asyncio.get_running_loop()
        self._handle: asyncio.TimerHandle | None = None

    def set(self, left_s: float) -> None:
        """Be due in `left_s`."""
        self.close()
        self._handle = self._loop.call_later(left_s, self._ring)

    def close(self) -> None:
        """Give the timer back."""
        if self._handle is not None:
            self._handle.cancel()


class Waker:
    """Sleeps in the running loop until a moment or until it is woken.

    One task sleeps; whoever has news for it calls `wake` from a callback of the same loop. News that comes while
    nobody sleeps is kept for the next sleep, which it ends at once.

    Parameters
    ----------
    clock : callable
        The clock that deadlines are given in, s; the run's may stand still before one.
    alarm : callable, optional
        Makes the alarm, in the loop of the first sleep; a timerfd where there is one.
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        alarm: Callable[[Callable[[], None]], Alarm] | None = None,
    ) -> None:
        self._clock = run_clock(clock)
        self._make_alarm = best_alarm if alarm is None else alarm
        self._alarm: Alarm | None = None
        self._sleep: asyncio.Future[None] | None = None
        self._woken = False

    def wake(self) -> None:
        """End the sleep, or the next one where nobody sleeps."""
        self._woken = True
        self._end()

    async def until(self, deadline_s: float) -> bool:
        """Sleep until `deadline_s` of the clock, and return whether `wake` ended the sleep before.

        The loop has taken in what had arrived before this returns, also where the deadline has passed long ago: a
        cycle after an overrun begins with what waited meanwhile.
        """
        left_s = self._clock.expect(deadline_s)
        if self._woken or left_s <= 0.0:
            for _ in range(_TURNS):
                await asyncio.sleep(0.0)
        else:
            if self._alarm is None:
                self._alarm = self._make_alarm(self._end)
            self._sleep = asyncio.get_running_loop().create_future()
            if left_s < math.inf:
                self._alarm.set(left_s)
            try:
                await self._sleep
            finally:
                self._sleep = None
        woken, self._woken = self._woken, False
        return woken

    def close(self) -> None:
        """Give the timer back; nobody may sleep any more."""
        if self._alarm is not None:
            self._alarm.close()
            self._alarm = None

    def _end(self) -> None:
        if self._sleep is not None and not self._sleep.done():
            self._sleep.set_result(None)


def best_alarm(ring: Callable[[], None]) -> Alarm:
    """Return the most exact alarm that this system has."""
    try:
        return TimerFd(ring)
    except OSError:
        return LoopTimer(ring)
