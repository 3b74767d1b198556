"""Drives through known rooms: odometry that drifts, and figures of what was said."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.trials.known_room_trials import SCALE_ERROR, STEP_M, Trace, figures, furnished_drive
from config.load import load_settings
from perception.localization.localized_pose import Status

pytestmark = pytest.mark.compiled
RING = load_settings("hallway").ring


@pytest.mark.parametrize("seed", [4, 5])
def test_odometry_drifts_by_its_scale(seed: int) -> None:
    drive = furnished_drive(RING, seed, length_m=3.0)
    steps = np.hypot(*np.diff(drive.truth[:, :2], axis=0).T)
    odometry = np.array([(firing.pose.x, firing.pose.y) for firing in drive.firings])
    by_odometry = np.hypot(*np.diff(odometry, axis=0).T)
    moved = steps > 1e-9
    assert np.abs(by_odometry[moved] / steps[moved] - 1.0) == pytest.approx(SCALE_ERROR)
    turns = np.abs(np.diff(drive.truth[:, 2]))
    assert (turns.max() > 0.0) == bool(seed % 2)  # odd rooms: the ring turns with the wheels
    assert len(drive.firings) == len(drive.truth)
    assert {
        int(np.isfinite(firing.ranges_m).sum() + np.isinf(firing.ranges_m).sum()) for firing in drive.firings
    } == {8}


def test_a_kidnapped_robot_is_carried_and_its_odometry_does_not_notice() -> None:
    drive = furnished_drive(RING, 4, length_m=3.0, kidnapped=True)
    steps = np.hypot(*np.diff(drive.truth[:, :2], axis=0).T)
    odometry = np.array([(firing.pose.x, firing.pose.y) for firing in drive.firings])
    assert drive.carried_at is not None
    assert steps.argmax() == drive.carried_at - 1
    assert np.hypot(*np.diff(odometry, axis=0).T).max() < 2.0 * STEP_M
    assert drive.way_m()[-1] == pytest.approx(steps.sum() - steps.max())


def test_a_moved_wall_is_heard_where_it_stands_and_mapped_where_it_stood() -> None:
    drive, moved = (furnished_drive(RING, 4, length_m=2.0, moved_wall_m=off) for off in (0.0, 0.6))
    assert np.array_equal(moved.room.walls, drive.room.walls)
    heard, other = (np.array([firing.ranges_m for firing in one.firings[:20]]) for one in (drive, moved))
    assert not np.array_equal(heard, other, equal_nan=True)


def test_figures_count_what_was_said() -> None:
    way = np.arange(7.0)
    error = np.array([9.0, 0.1, 0.1, 2.0, 2.0, 2.0, 0.1])
    sure = np.array([0.2, 0.8, 0.95, 0.95, 0.95, 0.95, 0.95])
    status: tuple[Status, ...] = ("localizing", "localizing", *("tracking",) * 5)
    never = Trace(way, error, error, 0.0 * sure, ("lost",) * 7)
    found = figures([Trace(way, error, 0.0 * error, sure, status, carried_at=4), never])
    assert (found.drives, found.found, found.way_median_m, found.way_max_m) == (2, 1, 2.0, math.inf)
    assert (found.kidnapped, found.recovered, found.noticed_max_m, found.recovered_max_m) == (1, 1, 1.0, 2.0)
    assert (found.said, found.said_wrong, found.drives_said_wrong) == (
        5,
        2,
        1,
    )  # the first after it was carried is not
    assert found.median_m == pytest.approx(0.1)
    assert found.lost_share == pytest.approx(0.5)
