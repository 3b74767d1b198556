"""The landmark filter along a drive: odometry, the kind of drive, slipping wheels, and the heading's random walk."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_settings
from perception.kernel import Floats
from perception.localization import landmark_tracker
from perception.localization.landmark_filter import add_landmark
from perception.localization.landmark_state import HEADING, X
from perception.localization.landmark_tracker import HEADING_WALK, POSE, LandmarkTracker

RING = load_settings(None).ring


def silent(x: float, theta: float, ring_yaw: float) -> Floats:
    """Return the row of a firing in which no sensor fired."""
    row = np.full(POSE + len(RING.mounts), -1.0)
    row[:POSE] = x, 0.0, theta, ring_yaw
    return row


def test_the_first_firing_gives_the_pose_and_the_next_ones_move_it() -> None:
    tracker = LandmarkTracker(RING)
    tracker.enter(silent(2.0, 0.1, 0.1))
    tracker.enter(silent(2.5, 0.1, 0.1))
    e = tracker.e[0]
    assert (tracker.entered, e.heading, tracker.range_max_m) == (2, 0.1, RING.range_max_m)
    assert (e.x, e.y) == pytest.approx((2.5, 0.0))
    assert tracker.covariance[HEADING, HEADING] == pytest.approx(0.5 * HEADING_WALK)


@pytest.mark.parametrize("is_synchro", [True, False])
def test_a_ring_that_does_not_turn_with_the_wheels_is_of_a_synchro_drive(is_synchro: bool) -> None:
    tracker = LandmarkTracker(RING)
    for k in range(3):
        tracker.enter(silent(0.1 * k, 0.2 * k, 0.0 if is_synchro else 0.2 * k))
    assert tracker.is_synchro == is_synchro


def test_while_no_echo_fits_odometry_is_trusted_less() -> None:
    tracker = LandmarkTracker(RING)
    tracker.enter(silent(0.0, 0.0, 0.0))
    tracker.e[0].fit_share = 0.3
    tracker.enter(silent(0.01, 0.0, 0.0))
    assert tracker.covariance[X, X] > 0.9 * landmark_tracker.SLIP_M**2


@pytest.mark.parametrize("degrees", [0.3, 3.0])
def test_the_random_walk_of_the_heading_is_found_from_the_corrections(degrees: float) -> None:
    """Each window's corrections are as large as the walk of that way, which is what a filter would correct in it."""
    walk, rng = math.radians(degrees) ** 2, np.random.default_rng(4)
    tracker = LandmarkTracker(RING)
    for _ in range(2):
        add_landmark(tracker.e, tracker.covariance, 3.0, 1.0, 1e-4, 0.0, 1e-4)
    for k in range(400):
        tracker.covariance[HEADING, HEADING] = 1e-4
        tracker.e[0].heading_correction += math.sqrt(walk * 0.25) * rng.standard_normal()
        tracker.enter(silent(0.25 * k, 0.0, 0.0))
        tracker.covariance[HEADING, HEADING] = 1e-4
    assert tracker.heading_walk == pytest.approx(math.sqrt(walk), rel=0.35)
    other = LandmarkTracker(RING)
    other.assume_walk_of(tracker)
    assert other.heading_walk == tracker.heading_walk
    tracker.reset()
    assert tracker.heading_walk == pytest.approx(math.sqrt(HEADING_WALK))
