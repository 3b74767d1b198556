"""The stall sampler: takes one sample of the stack when a cycle is overdue, to show what delays it.

asyncio's own search for slow callbacks needs its debug mode, which slows every callback. Here an interval timer is
set once a cycle to a moment at which the next cycle should long have started, and set again before it fires while
all cycles are on time. Where it fires, the interpreter passes the frame that it was about to execute.
"""

from __future__ import annotations

import asyncio
import selectors
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Final, NamedTuple

DELAY_MIN_S: Final = 1e-4
"""Shortest delay of the timer, s: a timer set to zero would be off."""


class StackSample(NamedTuple):
    """What was running."""

    callback: str
    """The outermost function: what the loop called."""
    function: str
    """The innermost function, where the interpreter was."""


class StallSampler:
    """Samples the stack at a given moment if the cycle has not started by then."""

    def __init__(self) -> None:
        self._is_active = False
        self._loop_files = (str(Path(asyncio.__file__).parent), selectors.__file__)
        self.sample: StackSample | None = None
        """What was running; None where no sample was due, or the loop was asleep."""

    @contextmanager
    def active(self) -> Iterator[None]:
        """Sample inside this context; does nothing outside the main thread or where SIGALRM is in use."""
        self._is_active = (
            threading.current_thread() is threading.main_thread()
            and signal.getsignal(signal.SIGALRM) == signal.SIG_DFL
            and signal.getitimer(signal.ITIMER_REAL)[0] == 0.0
        )
        if not self._is_active:
            yield
            return
        signal.signal(signal.SIGALRM, self._take_sample)
        try:
            yield
        finally:
            self._is_active = False
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, signal.SIG_DFL)

    def sample_after(self, delay_s: float) -> None:
        """Drop the last sample, and take one after this delay unless called again before."""
        self.sample = None
        if self._is_active:
            signal.setitimer(signal.ITIMER_REAL, max(delay_s, DELAY_MIN_S))

    def _take_sample(self, _number: int, frame: FrameType | None) -> None:
        """Keep the stack as of now: the handler of SIGALRM."""
        functions = []
        while frame is not None and not frame.f_code.co_filename.startswith(self._loop_files):
            functions.append(readable(frame.f_code.co_qualname))
            frame = frame.f_back
        # No function outside the loop's own code: the loop is asleep.
        self.sample = StackSample(functions[-1], functions[0]) if functions else None


def readable(qualified: str) -> str:
    """Return the name of a function for people: an inner one as "inner in outer"."""
    return " in ".join(reversed(qualified.split(".<locals>.")))
