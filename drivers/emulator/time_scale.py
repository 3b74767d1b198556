"""The time scale: the speed of the run's time, in a form that two processes evaluate identically.

The emulator and the program that drives it must pause, step and speed up together: otherwise the emulator's silence
raises an alarm, or its robot moves on while the run is paused. Both processes read the host's monotonic clock, so it
is enough that they agree on how the run's time follows from it. A `TimeScale` defines that by four numbers, from
which each process computes the run's time without asking the other.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

KEYWORD: Final = "time_scale"
"""First word of a message."""
FACTOR_MIN, FACTOR_MAX = 0.1, 10.0
"""Slowest and fastest time, seconds of the run per second of the host."""
MESSAGE_MAX: Final = 200
"""Longest message, bytes."""


class TimeScale(NamedTuple):
    """How the run's time follows from the host's."""

    host_s: float
    """A reading of the host's monotonic clock, s."""
    run_s: float
    """The run's time at that reading, s."""
    factor: float
    """Seconds of the run per second of the host."""
    until_s: float
    """The run's time stops when it gets here, s; inf = never."""

    def run_at(self, host_s: float) -> float:
        """Return the run's time at a reading of the host's clock, s."""
        return min(self.until_s, self.run_s + self.factor * max(0.0, host_s - self.host_s))

    def host_at(self, run_s: float) -> float:
        """Return the host's time at which the run's time gets to `run_s`, s; inf if it stops before."""
        return math.inf if run_s > self.until_s else self.host_s + (run_s - self.run_s) / self.factor

    @property
    def is_real_time(self) -> bool:
        """True if time passes at its natural speed without end: then neither process waits for the other."""
        return self.factor == 1.0 and self.until_s == math.inf

    def encode(self, number: int) -> bytes:
        """Return the time scale as a numbered message, a line of text that is exact to the bit."""
        return f"{KEYWORD} {number} {self.host_s!r} {self.run_s!r} {self.factor!r} {self.until_s!r}\n".encode()


REAL_TIME: Final = TimeScale(0.0, 0.0, 1.0, math.inf)
"""The run's time is the host's."""


def parse_time_scale(line: bytes) -> tuple[int, TimeScale]:
    """Return the message's number and its time scale.

    Raises
    ------
    ValueError
        The line is not such a message; the text says why.
    """
    if len(line) > MESSAGE_MAX:
        raise ValueError(f"a message has at most {MESSAGE_MAX} bytes")
    words = line.decode("ascii", errors="replace").split()
    if len(words) != 6 or words[0] != KEYWORD:
        raise ValueError(f"expected: {KEYWORD} NUMBER HOST_S RUN_S FACTOR UNTIL_S")
    try:
        number = int(words[1])
        host_s, run_s, factor, until_s = map(float, words[2:])
    except ValueError as error:
        raise ValueError("NUMBER must be an integer and the others numbers") from error
    if not (math.isfinite(host_s) and math.isfinite(run_s)):
        raise ValueError("HOST_S and RUN_S must be finite")
    if not FACTOR_MIN <= factor <= FACTOR_MAX:
        raise ValueError(f"FACTOR must be from {FACTOR_MIN:g} to {FACTOR_MAX:g}")
    if math.isnan(until_s):
        raise ValueError("UNTIL_S must be a number, or inf")
    return number, TimeScale(host_s, run_s, factor, until_s)
