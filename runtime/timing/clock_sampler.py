"""Four clocks read at once: from the differences one can tell work from waiting, and waiting from being held up.

Wall time without CPU time is time that something else had. A thread that gave up the processor by itself (it slept,
waited for a lock or a disk) has one more voluntary switch to show for it; one that was put aside has not.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from typing import NamedTuple

from runtime.timing.run_clock import run_clock


class ClockSample(NamedTuple):
    """What the clocks show at one moment."""

    run_s: float
    """The run's clock."""
    host_s: float
    """The host's monotonic clock, by which work is measured: the two part where the run's time is held."""
    thread_s: float
    """CPU time of this thread."""
    process_s: float
    """CPU time of all threads of this process."""
    waits: int
    """How often this thread gave up the processor by itself."""


class ClockSampler:
    """The clocks of this thread.

    Parameters
    ----------
    clock : callable
        Monotonic, s; or the run's.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = run_clock(clock)

    def read(self) -> ClockSample:
        """Return what the clocks show now; about 5 µs."""
        waits = resource.getrusage(resource.RUSAGE_THREAD).ru_nvcsw
        run_s, host_s = self._clock.both()
        return ClockSample(run_s, host_s, time.thread_time(), time.process_time(), waits)
