"""Who is running when a cycle is overdue: one look at the stack, paid for only by cycles that are late.

asyncio's own search for slow callbacks needs its debug mode, which costs every callback. Here an interval timer is
set once a cycle to a moment at which the next one should long have begun, and moved on before it rings while all is
well. Where it rings, the interpreter hands over the frame that it was about to go on with.
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

SOON_S: Final = 1e-4
"""A timer set to zero would be none."""


class StackSample(NamedTuple):
    """What was running."""

    callback: str
    """What the loop called."""
    function: str
    """Where in it, of all that is called, the interpreter was."""


class StallSampler:
    """Looks at the stack at a set moment, if the cycle has not begun by then."""

    def __init__(self) -> None:
        self._works = False
        self._machinery = (str(Path(asyncio.__file__).parent), selectors.__file__)
        self.seen: StackSample | None = None
        """What was running when it looked; None where it had no reason to, or the loop was asleep."""

    @contextmanager
    def on_duty(self) -> Iterator[None]:
        """Look from now on; outside the main thread, or where SIGALRM is another's, it stays blind."""
        self._works = (
            threading.current_thread() is threading.main_thread()
            and signal.getsignal(signal.SIGALRM) == signal.SIG_DFL
            and signal.getitimer(signal.ITIMER_REAL)[0] == 0.0
        )
        if not self._works:
            yield
            return
        signal.signal(signal.SIGALRM, self._look)
        try:
            yield
        finally:
            self._works = False
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, signal.SIG_DFL)

    def expect(self, within_s: float) -> None:
        """Forget what was seen; look unless called again within this time."""
        self.seen = None
        if self._works:
            signal.setitimer(signal.ITIMER_REAL, max(within_s, SOON_S))

    def _look(self, _number: int, frame: FrameType | None) -> None:
        functions = []
        while frame is not None and not frame.f_code.co_filename.startswith(self._machinery):
            functions.append(frame.f_code.co_qualname)
            frame = frame.f_back
        # Nothing but the loop's own machinery: it sleeps.
        self.seen = StackSample(functions[-1], functions[0]) if functions else None
