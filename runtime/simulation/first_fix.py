"""First fixes: how far before passing a drum its position is reliably known, so that the robot can still react.

The first fix is the first reading from which on, to the end of the drive, the drum is always reported to within a
quarter of a foot. A correct report that is withdrawn later does not count.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from statistics import median
from typing import Final, TypedDict

from config.units import FOOT_M
from config.world import DrumConfig
from perception.detected_object import DetectedObject

WITHIN_M: Final = 0.25 * FOOT_M
"""Largest position error of a fix: about the paper's mean error of 0.249 ft (Table 2)."""
EARLY_FIX_M: Final = 4.0 * FOOT_M
"""Distance before the drum at which a fix counts as early."""
ROUNDING_M: Final = 1e-9
"""Tolerance of that comparison."""


class FirstFix(TypedDict):
    """First fixes of all drums of a scene: metres along the hall before passing; negative after it."""

    least: float | None
    """None if a drum was never fixed."""
    median: float
    """Of the drums that were fixed."""
    share: float
    """Share of all drums that were fixed at least `EARLY_FIX_M` before."""


class FirstFixTracker:
    """Finds the first fix of each drum of one straight drive."""

    def __init__(self, drums: Sequence[DrumConfig]) -> None:
        self._drums = drums
        self._before: list[float | None] = [None] * len(drums)

    def update(self, x: float, seen: Iterable[DetectedObject]) -> None:
        """Add the objects reported with the robot at `x` (m) along the hall."""
        places = [(o.x, o.y) for o in seen]
        for i, drum in enumerate(self._drums):
            if not any(math.dist(place, (drum.x_m, drum.y_m)) <= WITHIN_M for place in places):
                self._before[i] = None
            elif self._before[i] is None:
                self._before[i] = drum.x_m - x

    def fixes(self) -> list[float | None]:
        """Return for each drum how far before it the robot was at the first fix, m; None without a fix."""
        return list(self._before)


def summarise_fixes(fixes: Sequence[float | None]) -> FirstFix | None:
    """Return minimum, median and the share of early fixes; None if no drum was ever fixed."""
    had = [fix for fix in fixes if fix is not None]
    if not had:
        return None
    return {
        "least": min(had) if len(had) == len(fixes) else None,
        "median": median(had),
        "share": sum(fix >= EARLY_FIX_M - ROUNDING_M for fix in had) / len(fixes),
    }
