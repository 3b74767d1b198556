"""Tests of the timeline: its start in the world, its end, and the Unix time of a moment."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers.messages import Pose
from runtime.analysis.timeline import Timeline
from tests.runtime.analysis.synthetic_timeline import SETTINGS, START_NS, synthetic_timeline


def test_an_empty_timeline_has_no_end_and_begins_at_the_origin() -> None:
    timeline = Timeline(Path("x"), SETTINGS, None)
    assert (timeline.last, timeline.objects, timeline.start) == (None, (), Pose(0.0, 0.0, 0.0))
    assert (timeline.start_unix_ns, timeline.unix_ns(1.5)) == (0, 1_500_000_000)


def test_the_end_is_the_last_snapshot() -> None:
    timeline = synthetic_timeline()
    assert timeline.last is timeline.snapshots[-1]
    assert timeline.objects is timeline.snapshots[-1].objects
    assert timeline.start.x == pytest.approx(-1.8288)


def test_unix_time_is_that_of_the_cycle_before() -> None:
    """After a pause the run's clock and Unix time differ by more."""
    timeline = synthetic_timeline()
    timeline.cycle_unix = [(0.0, START_NS), (1.0, START_NS + 1_000_000_000), (1.05, START_NS + 61_000_000_000)]
    assert timeline.start_unix_ns == START_NS
    assert timeline.unix_ns(1.02) == START_NS + 1_020_000_000
    assert timeline.unix_ns(1.06) == START_NS + 61_010_000_000
    assert timeline.unix_ns(-0.5) == START_NS - 500_000_000
