"""When the next cycle is due: deadlines on a fixed grid, and no burst after an overrun.

A loop that sleeps for a period drifts; one that catches up hammers the robot with stale commands. This one counts
the deadlines it missed and goes on with the next one that lies ahead.
"""

from __future__ import annotations

import math


class Pacer:
    """Deadlines at ``begin + k · period``.

    Parameters
    ----------
    begin_s, period_s : float
        The first deadline and the distance between two, s.
    """

    def __init__(self, begin_s: float, period_s: float) -> None:
        self._begin_s = begin_s
        self._period_s = period_s
        self._index = 0
        self.missed = 0
        """Deadlines that passed without a cycle."""

    @property
    def deadline_s(self) -> float:
        """When the cycle under way was due, s."""
        return self._begin_s + self._index * self._period_s

    def advance(self, now_s: float) -> float:
        """Go on to the next deadline after `now_s` and return it."""
        ahead = math.floor((now_s - self._begin_s) / self._period_s) + 1
        step = max(1, ahead - self._index)
        self.missed += step - 1
        self._index += step
        return self.deadline_s
