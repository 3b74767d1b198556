"""Repeats are found in tables of last values and in no table of firings."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.firing_pattern import firing_pattern
from runtime.recording.conventions.repeats import find_repeats
from runtime.recording.conventions.table import Table
from runtime.recording.ring_log import RingLogError
from tests.runtime.recording.conventions.tables import Drive, latched, make_drive


def repeats(drive: Drive) -> float:
    set_size = firing_pattern(drive.settings.ring).set_size
    return find_repeats(Table(drive.t, drive.pose, np.round(drive.ranges, 4)), set_size)


@pytest.mark.parametrize(
    ("robot", "world", "least"), [("p3dx", "room", 3.0), ("denning", "room", 1.5), ("denning", "hall", 1.5)]
)
def test_last_values_are_found_and_firings_are_fresh(robot: str, world: str, least: float) -> None:
    drive = make_drive(3, robot, world, "cone")
    assert repeats(drive) == 1.0
    assert repeats(latched(drive)) >= least


def test_a_table_that_shows_too_little_is_refused_with_the_option() -> None:
    with pytest.raises(RingLogError, match="say --latched yes if"):
        repeats(latched(make_drive(3, "denning", "hall", "cone"), 0.2))
