"""Odometry that comes too rarely to keep the line up: one lasting problem, in place of a line that flaps."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

GAPS_MIN: Final = 2
LATEST: Final = 3
"""So many gaps among the latest times between two samples are no restart and no replugged cable."""
RARE: Final = (
    "samples of odometry come more than {:g} s apart, after which the line counts as down; the robot sends them too "
    "rarely, or its line delivers them late: set the robot to send them at least every {:g} s, or raise "
    "link.silence_max_s, and look for what delays the line"
)


class OdometryGaps:
    """Detects odometry that comes too rarely: each sample would raise the line, and the wait for the next lower it.

    A restart or a loose cable makes one gap, and samples follow each other after it. Times are those of the looks, so
    that a gap is one in which a look found nothing for too long.

    Parameters
    ----------
    longest_s : float
        Longest gap after which the line is not down, s.
    """

    def __init__(self, longest_s: float) -> None:
        self._longest_s = longest_s
        self._looked_s = -math.inf
        self.begin()

    def begin(self) -> None:
        """Forget all samples, as for a line that has just been opened."""
        self._sample_s = -math.inf
        self._are_gaps: deque[bool] = deque(maxlen=LATEST)
        """Which of the latest times between samples are gaps."""
        self._gap_s, self._is_rare = 0.0, False
        """The last gap, s; whether there were too many, until there is none."""

    def look(self, run_s: float, *, came: bool) -> None:
        """Take whether a sample came since the last look; after a long time without a look, gaps say nothing."""
        before_s, self._looked_s = self._looked_s, run_s
        if run_s - before_s > self._longest_s:
            self.begin()
        elif came:
            is_gap = self._longest_s < before_s - self._sample_s < math.inf
            self._gap_s = run_s - self._sample_s if is_gap else self._gap_s
            self._sample_s = run_s
            self._are_gaps.append(is_gap)
            gaps = sum(self._are_gaps)
            self._is_rare = gaps > 0 and (self._is_rare or gaps >= GAPS_MIN)

    def problem(self, run_s: float) -> str | None:
        """Return what is wrong where the last samples came too rarely and the next is not long overdue."""
        if not self._is_rare or run_s - self._sample_s > 2.0 * self._gap_s:
            return None
        return RARE.format(self._longest_s, 0.5 * self._longest_s)
