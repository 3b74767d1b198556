"""How long before the robot passes a drum it is surely known where it stands: what a robot can still act upon.

A fix is sure from the first reading on after which the drum is always reported to within a quarter of a foot, to the
end of the drive: a right guess that is taken back is none.
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
EARLY_FIX_M: Final = 4.0 * FOOT_M
"""How long before is asked for."""
ROUNDING_M: Final = 1e-9


class FirstFix(TypedDict):
    """First sure fixes of all drums of a scene, metres along the hall before passing; negative after it."""

    least: float | None
    """Without where a drum was never fixed."""
    median: float
    """Of the drums that were."""
    share: float
    """Of all drums, how many were fixed `EARLY_FIX_M` before."""


class FirstFixTracker:
    """Watches the drums of one straight drive.

    Parameters
    ----------
    drums : sequence of DrumConfig
        What stands there.
    """

    def __init__(self, drums: Sequence[DrumConfig]) -> None:
        self._drums = drums
        self._before: list[float | None] = [None] * len(drums)

    def look(self, x: float, seen: Iterable[DetectedObject]) -> None:
        """Enter what is reported with the robot at `x` (m) along the hall."""
        places = [(o.x, o.y) for o in seen]
        for i, drum in enumerate(self._drums):
            if not any(math.dist(place, (drum.x_m, drum.y_m)) <= WITHIN_M for place in places):
                self._before[i] = None
            elif self._before[i] is None:
                self._before[i] = drum.x_m - x

    def fixes(self) -> list[float | None]:
        """Return for each drum how far before it the robot was at its first sure fix, m; None where there is none."""
        return list(self._before)


def summarise_fixes(fixes: Sequence[float | None]) -> FirstFix | None:
    """Return least, median and the share that was early enough; None where no drum was ever fixed."""
    had = [fix for fix in fixes if fix is not None]
    if not had:
        return None
    return {
        "least": min(had) if len(had) == len(fixes) else None,
        "median": median(had),
        "share": sum(fix >= EARLY_FIX_M - ROUNDING_M for fix in had) / len(fixes),
    }
