"""Work beside the cycles that rests while a cycle is due: Python runs one thread at a time.

A thread that works while a cycle runs takes the interpreter from it for milliseconds, each time that the cycle calls
the system. So what a start still has to do once the robot drives is done in threads that look at each call of a
function how far away the next cycle is. From Python 3.12 on a trace function in one thread makes all threads slow,
the cycles among them (a median of 207 µs became 553 µs): there the threads work as others do.
"""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Callable
from typing import Final, ParamSpec, TypeVar

from runtime.support.daemon_thread import in_daemon_thread

P = ParamSpec("P")
R = TypeVar("R")

IS_TRACED: Final = sys.version_info < (3, 12)
"""Whether threads look for the next cycle: a trace function costs only the thread that has it."""
MARGIN_S: Final = 0.01
"""Rest from this time before a cycle, s; a function of LLVM holds the interpreter for up to 15 ms."""
SHARE_MIN: Final = 0.5
"""Work for this share of a gap at least: at 200 Hz a gap is shorter than the margin, and loading must end."""
REST_MAX_S: Final = 0.1
"""Longest rest, s: while time is paused no cycle comes, and the thread may hold a lock that the loop needs."""


class CycleGaps:
    """Runs functions in threads that work only between cycles.

    Parameters
    ----------
    clock : callable
        Monotonic, s.
    rest_max_s : float
        Longest rest.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic, rest_max_s: float = REST_MAX_S) -> None:
        self._clock = clock
        self._rest_max_s = rest_max_s
        self._until_s = math.inf
        """Until when threads may work; −inf in a cycle."""
        self._opened = threading.Event()
        self._threads = 0

    def begin(self) -> None:
        """Let threads rest: a cycle begins."""
        self._until_s = -math.inf

    def end(self, gap_s: float) -> None:
        """Let threads work: a cycle has ended, and the next one is due in `gap_s`."""
        self._until_s = self._clock() + max(gap_s - MARGIN_S, SHARE_MIN * gap_s)
        if self._threads:
            self._opened.set()

    def close(self) -> None:
        """Let threads work for good: there is no further cycle."""
        self._until_s = math.inf
        self._opened.set()

    async def to_thread(self, call: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> R:
        """Call a function in a thread that rests in cycles, and return what it returns."""
        if not IS_TRACED:
            return await in_daemon_thread(call, *args, **kwargs)

        def resting() -> R:
            before = sys.gettrace()
            sys.settrace(self._rest)
            try:
                return call(*args, **kwargs)
            finally:
                sys.settrace(before)

        self._threads += 1
        try:
            return await in_daemon_thread(resting)
        finally:
            self._threads -= 1

    def _rest(self, *_: object) -> None:
        """Rest until the next gap, if none is now: Python calls this for each function that the thread calls."""
        if self._clock() < self._until_s:
            return
        self._opened.clear()
        if self._clock() >= self._until_s and not self._opened.wait(self._rest_max_s):  # it may have opened meanwhile
            self._until_s = max(self._until_s, self._clock() + self._rest_max_s)
