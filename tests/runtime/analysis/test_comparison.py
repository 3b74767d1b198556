"""Tests of the comparison of a run with a replay under other settings."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.settings import Settings
from runtime.analysis.comparison import Comparison, compare_runs
from runtime.recording.reader import RecordingError, open_recording
from tests.recorded import hall


def compared(run: Path, settings: Settings) -> Comparison:
    with open_recording(run) as recording:
        return compare_runs(recording, settings)


@pytest.mark.soak
@pytest.mark.compiled
def test_another_method_changes_objects_and_no_command(run: Path) -> None:
    """The robot drives along its leg, whatever is recognised."""
    got = compared(run, hall("perception.method=paper"))
    assert (got.changed_commands, got.first_change_s) == (0, None)
    assert got.cycles == 240
    assert got.recorded.errors_m is not None
    assert got.other.errors_m is not None
    assert len(got.recorded.errors_m) == len(got.other.errors_m) == 6
    best, paper = ([e for e in errors if e is not None] for errors in (got.recorded.errors_m, got.other.errors_m))
    assert len(best) >= 3
    assert max(best) < max(paper), "the paper's method has a bias"
    assert (got.recorded.stops, got.recorded.false) == ([], 0)


def test_another_clearance_changes_commands(run: Path) -> None:
    got = compared(
        run, hall("perception.method=paper", "behaviors.avoid_static_obstacle.avoid_obstacle_sphere_m=2.0")
    )
    assert got.changed_commands > 10
    assert got.first_change_s is not None
    assert got.first_change_s > 0.0


def test_another_ring_is_refused(run: Path) -> None:
    other = hall("ring.count=16")
    with pytest.raises(RecordingError, match="a ring of 24 sensors, and these settings are for one of 16"):
        compared(run, other)
