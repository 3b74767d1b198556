"""The resources that the process uses: start-up time, memory, CPU time, and kernels compiled too late.

Measured from the first cycle to the end of the run; the result goes into the run's summary.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Final, TypedDict

from runtime.support.kernel_cache import compiled_signatures
from runtime.timing.memory_policy import MemoryPolicy

_MEGA: Final = 1e6
_START_FIELD: Final = 19
"""Index of `starttime` in /proc/self/stat after the name, which is the only field that may contain a blank."""


class FootprintRow(TypedDict):
    """The resources that a run used; None where this system does not report them."""

    start_s: float | None
    """From the start of the process until the robot was ready for the first cycle."""
    cpu_share: float
    """CPU time of all threads while driving, as a share of one core."""
    rss_mb: float | None
    """Memory at the end, 10⁶ bytes."""
    rss_peak_mb: float | None
    growth_mb: float | None
    """Growth of the process's own memory since the first cycle, 10⁶ bytes."""
    compilations: int
    """Kernels compiled or loaded since the first cycle."""
    collections: list[int]
    """Garbage collections while driving, of each generation."""


class Footprint:
    """Measures this process from now, when the first cycle is about to begin, to `close`.

    Parameters
    ----------
    memory : MemoryPolicy
        Counts the collections.
    """

    def __init__(self, memory: MemoryPolicy) -> None:
        self._memory = memory
        self._start_s = age_s()
        self.begin()

    def begin(self) -> None:
        """Measure from now; the time of the start stays."""
        self._signatures = compiled_signatures()
        self._own_mb = own_mb()
        self._begin_host_s = time.monotonic()
        self._cpu_s = time.process_time()

    def close(self) -> FootprintRow:
        """Return what the run has used up to now."""
        driven_s = time.monotonic() - self._begin_host_s
        cpu_s = time.process_time() - self._cpu_s
        now_mb, before_mb = own_mb(), self._own_mb
        return {
            "start_s": _rounded(self._start_s, 2),
            "cpu_share": round(cpu_s / driven_s, 4) if driven_s > 0.0 else 0.0,
            "rss_mb": _rounded(rss_mb(), 1),
            "rss_peak_mb": _rounded(peak_mb(), 1),
            "growth_mb": None if now_mb is None or before_mb is None else round(now_mb - before_mb, 2),
            "compilations": compiled_signatures() - self._signatures,
            "collections": list(self._memory.collections),
        }


def age_s() -> float | None:
    """Return how long ago this process was started, to 0.01 s; None where the system does not report it."""
    try:
        fields = Path("/proc/self/stat").read_text("ascii", errors="replace").rpartition(")")[2].split()
        return time.clock_gettime(time.CLOCK_BOOTTIME) - int(fields[_START_FIELD]) / os.sysconf("SC_CLK_TCK")
    except (OSError, AttributeError):
        return None


def rss_mb() -> float | None:
    """Return the memory this process has in RAM, 10⁶ bytes; None where the system does not report it."""
    return _status_mb("VmRSS:")


def peak_mb() -> float | None:
    """Return the largest memory that this process had in RAM, 10⁶ bytes."""
    return _status_mb("VmHWM:")


def own_mb() -> float | None:
    """Return the memory that this process allocated, swapped out or not, 10⁶ bytes; pages of files do not count."""
    filled, swapped = _status_mb("RssAnon:"), _status_mb("VmSwap:")
    return rss_mb() if filled is None else filled + (swapped or 0.0)


def _status_mb(name: str) -> float | None:
    try:
        lines = Path("/proc/self/status").read_text("ascii", errors="replace").splitlines()
    except OSError:
        return None
    return next((int(line.split()[1]) * 1024 / _MEGA for line in lines if line.startswith(name)), None)


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)
