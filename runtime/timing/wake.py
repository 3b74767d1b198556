"""Sleep until a deadline to the microsecond, or until woken.

asyncio passes its timeouts to epoll in whole milliseconds, rounded up, and the kernel may add its timer slack: a
cycle that sleeps that way begins 0.7 ms late at the median. A timerfd is a timer that the loop waits for as for any
other file: it counts nanoseconds and gets no slack. `bench/waking.py` compares it with the alternatives.
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
"""Size of what is read from a timerfd: the number of times that it fired."""
_LOOP_TURNS: Final = 2
"""Turns of the loop until pending input is processed: the first finds it, the second follows its callbacks."""


class _TimeSpec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


class _TimerSpec(ctypes.Structure):
    _fields_ = (("interval", _TimeSpec), ("value", _TimeSpec))


class Timer(Protocol):
    """A timer that calls back once after a delay; setting it again cancels the earlier call."""

    def set(self, delay_s: float) -> None:
        """Call back after `delay_s`; never if it is inf."""

    def close(self) -> None:
        """Release the timer; it never calls again."""


class TimerFd:
    """A timer of the kernel, exact, and Linux only; the callback is called in the loop that runs now.

    Raises
    ------
    OSError
        This system has no such timer.
    """

    def __init__(self, callback: Callable[[], None]) -> None:
        libc = ctypes.CDLL(None, use_errno=True)
        try:
            create, self._settime = libc.timerfd_create, libc.timerfd_settime
        except AttributeError as error:
            raise OSError("this system has no timerfd") from error
        self._callback = callback
        self._loop = asyncio.get_running_loop()
        self._spec = _TimerSpec()
        self._fd: int = create(time.CLOCK_MONOTONIC, os.O_NONBLOCK | os.O_CLOEXEC)
        if self._fd < 0:
            raise OSError(ctypes.get_errno(), "cannot create a timer")
        self._loop.add_reader(self._fd, self._on_readable)

    def set(self, delay_s: float) -> None:
        """Call back after `delay_s`: at once if it is negative, never if it is inf."""
        value = self._spec.value
        # Zero switches the timer off.
        delay_ns = 0 if delay_s == math.inf else max(1, math.ceil(delay_s * 1e9))
        value.seconds, value.nanoseconds = divmod(delay_ns, 1_000_000_000)
        self._settime(self._fd, 0, ctypes.byref(self._spec), None)

    def close(self) -> None:
        """Release the timer."""
        self._loop.remove_reader(self._fd)
        os.close(self._fd)

    def _on_readable(self) -> None:
        try:
            os.read(self._fd, _COUNT_BYTES)
        except BlockingIOError:  # it was set again in the same turn of the loop
            return
        self._callback()


class LoopTimer:
    """A timer of the loop, to the millisecond: for systems without a timerfd."""

    def __init__(self, callback: Callable[[], None]) -> None:
        self._callback = callback
        self._loop = asyncio.get_running_loop()
        self._handle: asyncio.TimerHandle | None = None

    def set(self, delay_s: float) -> None:
        """Call back after `delay_s`; never if it is inf."""
        self.close()
        if delay_s < math.inf:
            self._handle = self._loop.call_later(delay_s, self._callback)

    def close(self) -> None:
        """Release the timer."""
        if self._handle is not None:
            self._handle.cancel()


class Waker:
    """Sleeps in the running loop until a deadline or until it is woken.

    One task sleeps; callbacks of the same loop call `wake`. A `wake` that comes outside a sleep ends the next one at
    once.

    Parameters
    ----------
    clock : callable
        The clock of the deadlines, s. A `RunClock` may be paused: a sleep then lasts until `wake`, so the owner
        registers `clock.on_change(waker.wake)`.
    make_timer : callable, optional
        Makes the timer for a callback, in the loop of the first sleep; by default a timerfd where there is one.
    """

    def __init__(
        self,
        clock: Callable[[], float] = time.monotonic,
        make_timer: Callable[[Callable[[], None]], Timer] | None = None,
    ) -> None:
        self._clock = run_clock(clock)
        self._make_timer = best_timer if make_timer is None else make_timer
        self._timer: Timer | None = None
        """None before the first sleep that needs one."""
        self._sleep: asyncio.Future[None] | None = None
        """What the sleeping task waits for; None outside a sleep."""
        self._woken = False
        """Whether `wake` was called since the last sleep ended."""

    def wake(self) -> None:
        """End the sleep, or the next one outside a sleep."""
        self._woken = True
        self._end()

    async def until(self, deadline_s: float) -> bool:
        """Sleep until `deadline_s` of the clock, and return whether `wake` ended the sleep before.

        The loop processes its pending input before this returns, also where the deadline passed long ago: a cycle
        after an overrun takes in what arrived meanwhile.
        """
        delay_s = self._clock.expect(deadline_s)
        if self._woken or delay_s <= 0.0:
            for _ in range(_LOOP_TURNS):
                await asyncio.sleep(0.0)
        else:
            if self._timer is None:
                self._timer = self._make_timer(self._end)
            self._sleep = asyncio.get_running_loop().create_future()
            self._timer.set(delay_s)
            try:
                await self._sleep
            finally:
                self._sleep = None
        woken, self._woken = self._woken, False
        return woken

    def close(self) -> None:
        """Release the timer; there must be no further sleep."""
        if self._timer is not None:
            self._timer.close()
            self._timer = None

    def _end(self) -> None:
        if self._sleep is not None and not self._sleep.done():
            self._sleep.set_result(None)


def best_timer(callback: Callable[[], None]) -> Timer:
    """Return the most exact timer that this system has."""
    try:
        return TimerFd(callback)
    except OSError:
        return LoopTimer(callback)
