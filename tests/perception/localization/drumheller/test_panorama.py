"""Panoramas: readings of several firings in one frame."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.messages import Firing, Pose
from perception.localization.drumheller.panorama import all_readings, panoramas
from tests.perception.localization.rooms import RING


def firing(pose: Pose, yaw: float, first: int = 0, every: int = 1) -> Firing:
    """The firing of every so many sensors, whose ranges are their numbers."""
    ranges = np.full(24, math.nan)
    ranges[first::every] = np.arange(24.0)[first::every]
    return Firing(0.0, pose, yaw, ranges)


def test_octets_at_one_place_are_one_panorama() -> None:
    (found,) = panoramas([firing(Pose(3.0, 4.0, 0.5), 2.0, k, 3) for k in range(3)], RING)
    assert np.column_stack([found.x, found.y, found.axis]) == pytest.approx(np.array(RING.mounts))
    assert found.range_m.tolist() == list(range(24))


def test_a_drive_is_placed_in_the_frame_of_the_ring_at_its_last_firing() -> None:
    """The ring's yaw counts, not the direction in which the wheels drive."""
    before, after = Pose(1.0, 0.0, 0.3), Pose(1.0, 2.0, 0.7)
    first, last = panoramas([firing(before, 0.0), firing(after, math.pi / 2)], RING)
    mounts = np.array(RING.mounts)
    assert np.column_stack([last.x, last.y, last.axis]) == pytest.approx(mounts)
    # Seen from the second place, which looks along y, the first lies 2 m behind, turned by a quarter to the right.
    assert first.x == pytest.approx(mounts[:, 1] - 2.0)
    assert first.y == pytest.approx(-mounts[:, 0])
    assert first.axis == pytest.approx(mounts[:, 2] - math.pi / 2)


def test_readings_of_sensors_that_did_not_fire_are_left_out() -> None:
    parts = panoramas([firing(Pose(0.0, 0.0, 0.0), 0.0), firing(Pose(0.0, 0.0, 0.0), 0.0, 1, 3)], RING)
    assert len(parts) == 2
    assert all_readings(parts).range_m.tolist() == [*range(24), *range(1, 24, 3)]
