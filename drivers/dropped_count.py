"""A count of what a driver drops, of which the operator hears when it grows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

NOTED_FROM: Final = 64
"""Fewer are not noted: where a line starts or breaks, some are dropped."""
LATE_FIRINGS: Final = (
    "{} firings were dropped so far: no odometry lies around their moment, or a later one came first; likely the "
    "line loses bytes or the robot's clock jumps: check the cable and what else uses the line"
)
RANGES_BEYOND: Final = (
    "{} ranges were dropped so far: they lie beyond the window of their firing, as echoes of an earlier one do, or "
    "the maximum of a sensor that hears nothing; if there are ever more, set a longer ring.firing.window_m or "
    "step_period_s, or let the sensor report no echo there (`echolocate ring-test` shows which does not)"
)


class DroppedCount:
    """How many were dropped; a note says so when there are `NOTED_FROM`, and each time they have doubled since.

    The text is `LATE_FIRINGS` or `RANGES_BEYOND`.
    """

    def __init__(self, text: str, note: Callable[[str], None]) -> None:
        self.count = 0
        self._text, self._note = text, note

    def add(self, count: int = 1) -> None:
        """Count so many more."""
        before, self.count = self.count, self.count + count
        if (self.count // NOTED_FROM).bit_length() > (before // NOTED_FROM).bit_length():
            self._note(self._text.format(self.count))
