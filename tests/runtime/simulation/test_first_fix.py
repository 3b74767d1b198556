"""Tests of first fixes: how far before passing a drum it was located for good."""

from __future__ import annotations

import pytest

from config.world import DrumConfig
from perception.detected_object import DetectedObject
from runtime.simulation.first_fix import EARLY_FIX_M, WITHIN_M, FirstFixTracker, summarise_fixes

DRUMS = [DrumConfig(x_m=x, y_m=1.0, radius_m=0.3) for x in (2.0, 5.0)]


def seen(x: float, y: float = 1.0) -> DetectedObject:
    return DetectedObject("semicircle", x, y, 0.0, 0.01, 9, 0.9)


def test_a_fix_counts_from_where_it_is_kept() -> None:
    tracker = FirstFixTracker(DRUMS)
    tracker.update(0.0, [seen(2.0)])
    tracker.update(0.5, [])  # withdrawn: the report before it does not count
    tracker.update(1.0, [seen(2.0 + 0.99 * WITHIN_M), seen(5.0 + 1.01 * WITHIN_M)])
    tracker.update(1.5, [seen(2.0)])
    assert tracker.fixes() == [1.0, None]
    tracker.update(6.0, [seen(2.0), seen(5.0)])
    assert tracker.fixes() == [1.0, -1.0], "negative after it was passed"


def test_the_summary_of_fixes() -> None:
    assert summarise_fixes([]) is None
    assert summarise_fixes([None, None]) is None
    assert summarise_fixes([EARLY_FIX_M, 1.0, -0.5]) == {
        "least": -0.5, "median": 1.0, "share": pytest.approx(1 / 3),
    }  # fmt: skip
    some = summarise_fixes([EARLY_FIX_M - 1e-12, None])
    assert some == {"least": None, "median": pytest.approx(EARLY_FIX_M), "share": 0.5}
