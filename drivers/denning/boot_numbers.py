"""The boot numbers that robots report, by which two robots on one line differ from one that restarts."""

from __future__ import annotations

import math
from typing import Final

TWO_RESTARTS_S: Final = 5.0
"""A robot takes longer to restart twice."""


class BootNumbers:
    """The numbers that came on a line."""

    def __init__(self) -> None:
        self._earlier: int | None = None
        """That of the robot that answered before the present one."""
        self._changed_s = -math.inf

    def are_of_two(self, known: int, boot: int, run_s: float) -> bool:
        """Return whether a new number is that of the robot before the present one, and too soon for its restart.

        Parameters
        ----------
        known, boot : int
            The number so far, and the one that has come.
        run_s : float
            Now, by the run's clock.
        """
        if boot == known:
            return False
        is_back = boot == self._earlier and run_s - self._changed_s < TWO_RESTARTS_S
        self._earlier, self._changed_s = known, run_s
        return is_back
