"""The pace of a run's time, as a law that two processes read alike.

An emulator that is paused, stepped or sped up is of use only if the program that drives it lives in the same time:
else its silence is an alarm, and its robot goes on where it was not to move. Both processes see the host's monotonic
clock, so what they must agree on is only how the run's time follows from that. The law is four numbers; whoever
holds them knows the run's time at any moment without asking the other.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

WORD: Final = "pace"
FACTOR_MIN, FACTOR_MAX = 0.1, 10.0
LINE_MAX: Final = 200
"""Bytes of a line, at most."""


class TimeScale(NamedTuple):
    """How the run's time follows from the host's."""

    host_s: float
    """At this moment of the host's clock, s …"""
    run_s: float
    """… the run's clock showed this, s."""
    factor: float
    """So many seconds of the run go by in one of the host."""
    until_s: float
    """The run's time stands still once it is so late, s."""

    def at(self, host_s: float) -> float:
        """Return the run's time at a moment of the host's clock."""
        return min(self.until_s, self.run_s + self.factor * max(0.0, host_s - self.host_s))

    def host_at(self, run_s: float) -> float:
        """Return when the run's clock comes to a time; inf where it stands still before."""
        return math.inf if run_s > self.until_s else self.host_s + (run_s - self.run_s) / self.factor

    @property
    def is_free(self) -> bool:
        """Whether time goes by as it does for everybody: then no side waits for the other."""
        return self.factor == 1.0 and self.until_s == math.inf

    def line(self, number: int) -> bytes:
        """Return the law as a line of text, exact to the bit."""
        return f"{WORD} {number} {self.host_s!r} {self.run_s!r} {self.factor!r} {self.until_s!r}\n".encode()


REAL: Final = TimeScale(0.0, 0.0, 1.0, math.inf)
"""The run's time is the host's."""


def pace_in(line: bytes) -> tuple[int, TimeScale]:
    """Return the number and the law in a line.

    Raises
    ------
    ValueError
        It is no such line; the text says why.
    """
    if len(line) > LINE_MAX:
        raise ValueError(f"a line has {LINE_MAX} bytes at most")
    words = line.decode("ascii", errors="replace").split()
    if len(words) != 6 or words[0] != WORD:
        raise ValueError(f"a line is: {WORD} NUMBER HOST_S RUN_S FACTOR UNTIL_S")
    try:
        number = int(words[1])
        host_s, run_s, factor, until_s = map(float, words[2:])
    except ValueError as error:
        raise ValueError("NUMBER must be a whole number and the others numbers") from error
    if not (math.isfinite(host_s) and math.isfinite(run_s)):
        raise ValueError("HOST_S and RUN_S must be finite")
    if not FACTOR_MIN <= factor <= FACTOR_MAX:
        raise ValueError(f"FACTOR must be from {FACTOR_MIN:g} to {FACTOR_MAX:g}")
    if math.isnan(until_s):
        raise ValueError("UNTIL_S must be a number, or inf")
    return number, TimeScale(host_s, run_s, factor, until_s)
