"""Samples of four clocks: their differences distinguish work, waiting, and suspension by the system.

Elapsed time without CPU time is time in which this thread did not run. A thread that gave up the processor itself (it
slept, waited for a lock or a disk) has one more voluntary context switch; one that the system suspended has not.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from resource import RUSAGE_THREAD, getrusage
from time import process_time, thread_time
from typing import Final, NamedTuple

from runtime.timing.run_clock import run_clock

OTHERS_AGE_S: Final = 1e-3
"""How old the other threads' time may be: reading it takes as long as reading all else."""

QUICK_S: Final = 1e-3
"""Work that took less delays no cycle by itself, so that nothing is asked about what suspended it."""


class ClockSample(NamedTuple):
    """All clocks at one moment."""

    run_s: float
    """The run's clock."""
    host_s: float
    """The host's monotonic clock, by which work is measured; the run's differs from it once time was paused."""
    thread_s: float
    """CPU time of this thread."""
    others_s: float
    """CPU time of this process's other threads, at most `OTHERS_AGE_S` ago."""
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
        self._others_s, self._others_host_s = 0.0, -math.inf

    def read(self) -> ClockSample:
        """Return all clocks as of now; takes about 4 µs, and twice as long where the caches are cold.

        The thread's clock is asked by itself: the times of `getrusage` may be as old as the kernel's last tick, 4 ms.
        """
        thread = getrusage(RUSAGE_THREAD)
        run_s, host_s = self._clock.both()
        thread_s = thread_time()
        if host_s - self._others_host_s >= OTHERS_AGE_S:
            self._others_s, self._others_host_s = process_time() - thread_s, host_s
        return ClockSample(run_s, host_s, thread_s, self._others_s, thread.ru_nvcsw)

    def read_after(self, begin: ClockSample) -> ClockSample:
        """Return all clocks at the end of work that began at `begin`; after quick work as if nothing suspended it.

        The clocks of a thread are two system calls, most of the cost of a sample, and each phase of a cycle ends with
        one.
        """
        run_s, host_s = self._clock.both()
        took_s = host_s - begin.host_s
        if took_s >= QUICK_S:
            return self.read()
        return ClockSample(run_s, host_s, begin.thread_s + took_s, begin.others_s, begin.waits)
