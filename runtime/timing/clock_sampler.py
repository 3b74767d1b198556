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

    wall_s: float
    thread_s: float
    """CPU time of this thread."""
    process_s: float
    """CPU time of all threads of this process."""
    waits: int
    """How often this thread gave up the processor by itself."""
    ahead_s: float = 0.0
    """How far the host's clock is ahead of the run's, which `wall_s` is by: they part where time can be held."""

    @property
    def host_s(self) -> float:
        """The moment by the host's clock: what work takes is counted by that one."""
        return self.wall_s + self.ahead_s


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
        host_s = self._clock.host()
        wall_s = self._clock.at(host_s)
        return ClockSample(wall_s, time.thread_time(), time.process_time(), waits, host_s - wall_s)
