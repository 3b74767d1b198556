"""The landmark filter along a drive: odometry, the kind of drive, slipping wheels, and the heading's random walk."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_settings
from drivers.messages import Pose
from perception.kernel import Floats
from perception.localization.drift import landmark_tracker
from perception.localization.drift.landmark_filter import add_landmark
from perception.localization.drift.landmark_state import FIRST, HEADING, X, Y
from perception.localization.drift.landmark_tracker import POSE, LandmarkTracker, fit_of_turn

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
    assert tracker.covariance[HEADING, HEADING] == pytest.approx(0.5 * tracker.heading_walk**2)
    assert math.radians(0.8) < tracker.heading_walk < math.radians(1.3)


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


@pytest.mark.parametrize("failures", [1, 2])
def test_while_a_landmark_fails_again_and_again_the_place_by_odometry_is_trusted_less(failures: int) -> None:
    tracker = LandmarkTracker(RING)
    tracker.enter(silent(0.0, 0.0, 0.0))
    add_landmark(tracker.e, tracker.covariance, 3.0, 1.0, 1e-4, 0.0, 1e-4)
    tracker.e[0].landmarks[0].failures = failures
    tracker.enter(silent(0.01, 0.0, 0.0))
    assert (tracker.covariance[X, X] > 0.9 * landmark_tracker.FAILING_M**2) == (failures == 2)


def test_a_displacement_moves_the_ring_alone_and_makes_it_uncertain_alone() -> None:
    tracker = LandmarkTracker(RING)
    tracker.enter(silent(1.0, 0.5, 0.5))
    add_landmark(tracker.e, tracker.covariance, 2.0, 1.0, 1e-4, 0.0, 1e-4)
    e, n = tracker.e[0], FIRST + 2
    landmark = e.landmarks[0].x, e.landmarks[0].y
    tracker.covariance[:n, :n] = 0.0
    given = np.array([[4e-4, 1e-5, 2e-5], [1e-5, 9e-4, -3e-5], [2e-5, -3e-5, 1e-4]])
    tracker.displace(Pose(0.2, -0.1, 0.3), given)
    true = Pose(1.0, 0.0, 0.5).compose(Pose(0.2, -0.1, 0.3))
    assert (e.x, e.y, e.heading) == pytest.approx((true.x, true.y, true.theta))
    assert (e.landmarks[0].x, e.landmarks[0].y) == landmark
    to = np.zeros((5, n))
    to[0, X] = to[1, Y] = to[2, HEADING] = to[3, FIRST] = to[4, FIRST + 1] = 1.0
    to[:2, HEADING], to[3:, HEADING] = (-e.y, e.x), (-landmark[1], landmark[0])
    real = to @ tracker.covariance[:n, :n] @ to.T
    c, s = math.cos(0.5), math.sin(0.5)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(real[:3, :3], turn @ given @ turn.T, atol=1e-12)
    np.testing.assert_allclose(real[3:], 0.0, atol=1e-12)


def test_several_landmarks_that_fail_at_once_let_the_pose_be_doubted() -> None:
    tracker = LandmarkTracker(RING)
    for k in range(3):
        add_landmark(tracker.e, tracker.covariance, 2.0, float(k), 1e-4, 0.0, 1e-4)
    assert not tracker.is_doubtful
    tracker.e[0].landmarks[0].failures = 5
    assert not tracker.is_doubtful
    tracker.e[0].landmarks[2].failures = 2
    assert tracker.is_doubtful


@pytest.mark.covered
@pytest.mark.parametrize("degrees", [0.3, 3.0])
def test_the_random_walk_of_the_heading_is_found_from_the_corrections(degrees: float) -> None:
    """The landmarks turn against the ring by the walk of each way, and are seen again to a fifth of a degree."""
    walk, rng = math.radians(degrees) ** 2, np.random.default_rng(4)
    tracker = LandmarkTracker(RING)
    for side in (1.0, -1.0):
        add_landmark(tracker.e, tracker.covariance, 3.0, side, 1e-4, 0.0, 1e-4)
    seen, off = math.radians(0.2) ** 2, 0.0
    for k in range(400):
        off += math.sqrt(walk * 0.25) * rng.standard_normal()
        tracker.enter(silent(0.25 * k, 0.0, 0.0))
        fit = fit_of_turn(np.column_stack(tracker.landmarks("x", "y")))
        across = tracker.covariance[FIRST : FIRST + 4, FIRST : FIRST + 4]
        carried = across @ fit
        variance = float(fit @ carried)
        gain = variance / (variance + seen)
        across -= gain * np.outer(carried, carried) / variance
        correction = gain * (off + math.sqrt(seen) * rng.standard_normal())
        tracker.e[0].heading_correction += correction
        off -= correction
    assert tracker.heading_walk == pytest.approx(math.sqrt(walk), rel=0.25)
    other = LandmarkTracker(RING)
    other.assume_walk_of(tracker)
    assert other.heading_walk == tracker.heading_walk
    tracker.reset()
    assert tracker.heading_walk == LandmarkTracker(RING).heading_walk
