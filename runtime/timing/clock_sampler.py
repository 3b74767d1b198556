"""Samples of four clocks: their differences distinguish work, waiting, and suspension by the system.

Elapsed time without CPU time is time in which this thread did not run. A thread that gave up the processor itself (it
slept, waited for a lock or a disk) has one more voluntary context switch; one that the system suspended has not.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from resource import RUSAGE_THREAD, getrusage
from time import process_time
from typing import NamedTuple

from runtime.timing.run_clock import run_clock


class ClockSample(NamedTuple):
    """All clocks at one moment."""

    run_s: float
    """The run's clock."""
    host_s: float
    """The host's monotonic clock, by which work is measured; the run's differs from it once time was paused."""
    thread_s: float
    """CPU time of this thread."""
    process_s: float
    """CPU time of all threads of this process."""
    waits: int
    """Voluntary context switches of this thread so far."""


class ClockSampler:
    """Reads the clocks of the calling thread.

    Parameters
    ----------
    clock : callable
        The run's, or any monotonic clock, s.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = run_clock(clock)

    def read(self) -> ClockSample:
        """Return all clocks as of now; takes about 5 µs."""
        thread = getrusage(RUSAGE_THREAD)
        run_s, host_s = self._clock.both()
        return ClockSample(run_s, host_s, thread.ru_utime + thread.ru_stime, process_time(), thread.ru_nvcsw)
