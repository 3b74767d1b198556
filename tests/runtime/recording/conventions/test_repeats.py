"""Repeats are found in tables of last values and in no table of firings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.firing_pattern import firing_pattern
from drivers.latched_ranges import RepeatFilter
from drivers.messages import Firing, Pose
from runtime.recording.conventions.repeats import Repeats, find_repeats, noise_of_repeats
from runtime.recording.conventions.table import Table
from runtime.recording.ring_log import RingLogError
from tests.runtime.recording.conventions.tables import Drive, latched, make_drive


def found(drive: Drive) -> Repeats:
    set_size = firing_pattern(drive.settings.ring).set_size
    return find_repeats(Table(drive.t, drive.pose, np.round(drive.ranges, 4)), set_size)


def repeats(drive: Drive) -> float:
    return found(drive).rows


@pytest.mark.parametrize(
    ("robot", "world", "least"), [("p3dx", "room", 3.0), ("denning", "room", 1.5), ("denning", "hall", 1.5)]
)
def test_last_values_are_found_and_firings_are_fresh(robot: str, world: str, least: float) -> None:
    drive = make_drive(3, robot, world, "cone")
    assert repeats(drive) == 1.0
    assert repeats(latched(drive)) >= least


@pytest.mark.parametrize("robot", ["p3dx", "magellan"])
@pytest.mark.parametrize("share", [1.25, 1.2, 1.1])
def test_rows_a_little_faster_than_the_ring_repeat_one_value_in_a_few(robot: str, share: float) -> None:
    drive = make_drive(3, robot, "room", "cone")
    cycle_s = firing_pattern(drive.settings.ring).cycle_s
    assert repeats(latched(drive, cycle_s / share)) == pytest.approx(share, abs=0.01)
    assert repeats(latched(drive, cycle_s * share)) == 1.0, "each row has new values"


@pytest.mark.parametrize(("drives", "stands"), [(6, 2), (3, 3), (2, 2), (20, 5)])
def test_a_robot_that_drives_and_stops_repeats_nothing(drives: int, stands: int) -> None:
    """Its ranges change at each row, and all stop to change where it stands."""
    drive = make_drive(3, "p3dx", "room", "cone")
    cycle_s = firing_pattern(drive.settings.ring).cycle_s
    fresh = latched(drive, 1.2 * cycle_s)
    row = np.cumsum(np.arange(len(fresh.t)) % (drives + stands) < drives) - 1
    assert repeats(replace(fresh, pose=fresh.pose[row], ranges=fresh.ranges[row])) == 1.0


@pytest.mark.parametrize("share", [1.25, 1.1])
def test_repeats_are_found_although_the_odometry_comes_at_every_second_row(share: float) -> None:
    drive = make_drive(3, "p3dx", "room", "cone")
    rows = latched(drive, firing_pattern(drive.settings.ring).cycle_s / share)
    held = replace(rows, pose=rows.pose[np.arange(len(rows.t)) // 2 * 2])
    assert repeats(held) == pytest.approx(share, abs=0.01)


def test_a_table_that_shows_too_little_is_refused_with_the_option() -> None:
    with pytest.raises(RingLogError, match="say --latched yes if"):
        repeats(latched(make_drive(3, "denning", "hall", "cone"), 0.2))


@pytest.mark.parametrize("robot", ["p3dx", pytest.param("denning", marks=pytest.mark.soak)])
def test_noise_of_the_last_digit_does_not_make_last_values_fresh(robot: str) -> None:
    drive, rng = make_drive(3, robot, "room", "cone"), np.random.default_rng(3)
    clean = latched(drive)
    noisy = replace(clean, ranges=clean.ranges + 1e-4 * rng.integers(-1, 2, clean.ranges.shape))
    assert found(noisy).rows == repeats(clean)
    assert 2e-4 < found(noisy).same < 3e-4
    assert "in the file's unit" in found(noisy).words
    assert noise_of_repeats(Table(clean.t, clean.pose, np.round(clean.ranges, 4))) == 0.0
    kept, held = RepeatFilter(clean.ranges.shape[1], 1e3), RepeatFilter(clean.ranges.shape[1], 1e3, found(noisy).same)
    rows = [Firing(t, Pose(0.0, 0.0, 0.0), 0.0, row) for t, row in zip(clean.t, clean.ranges, strict=True)]
    others = [replace(one, ranges_m=row) for one, row in zip(rows, noisy.ranges, strict=True)]
    fresh = [~np.isnan(kept.fresh(one).ranges_m) for one in rows]
    again = [~np.isnan(held.fresh(one).ranges_m) for one in others]
    assert np.mean(np.array(fresh) == np.array(again)) > 0.99
