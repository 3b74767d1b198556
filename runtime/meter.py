"""Four clocks read at once: from the differences one can tell work from waiting, and waiting from being held up.

Wall time without CPU time is time that something else had. A thread that gave up the processor by itself (it slept,
waited for a lock or a disk) has one more voluntary switch to show for it; one that was put aside has not.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from typing import NamedTuple


class Reading(NamedTuple):
    """What the clocks show at one moment."""

    wall_s: float
    thread_s: float
    """CPU time of this thread."""
    process_s: float
    """CPU time of all threads of this process."""
    waits: int
    """How often this thread gave up the processor by itself."""


class Meter:
    """The clocks of this thread.

    Parameters
    ----------
    clock : callable
        Monotonic, s.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock

    def read(self) -> Reading:
        """Return what the clocks show now; about 5 µs."""
        waits = resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw
        return Reading(self._clock(), time.thread_time(), time.process_time(), waits)
