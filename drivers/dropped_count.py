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
ONE_RANGE: Final = (
    "sensors answer {:.3f} m in turn, beyond the window of their firing: no echo but what they report where they "
    "hear nothing; it is taken for that; let the sensor or its driver report no echo there (`echolocate ring-test` "
    "shows which does not)"
)
ALIKE_MIN: Final = 4
"""So many ranges beyond the window in succession that equal the one before, which was another sensor's, are no
echoes: those of earlier firings lie anywhere."""


class MaximumBeyond:
    """Finds the range beyond the window that sensors report in place of silence; a note says so once."""

    def __init__(self, note: Callable[[str], None]) -> None:
        self._note = note
        self._last: tuple[int, float] | None = None
        self._alike = 0
        self._nothing_m: float | None = None

    def is_silence(self, sensor: int, range_m: float, step_m: float) -> bool:
        """Take a range beyond the window, in steps of so much, m, and return whether it stands for a silence."""
        if self._nothing_m is not None:
            return abs(range_m - self._nothing_m) < 1.5 * step_m
        before, self._last = self._last, (sensor, range_m)
        if before is not None and abs(range_m - before[1]) > 1.5 * step_m:
            self._alike = 0
        elif before is not None and before[0] != sensor:
            self._alike += 1
        if self._alike < ALIKE_MIN:
            return False
        self._nothing_m = range_m
        self._note(ONE_RANGE.format(range_m))
        return True


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
