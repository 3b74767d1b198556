"""Drift correction on synthetic firings: the delayed start, the pose, objects that moved, and a slipped robot."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_settings
from drivers.messages import Firing, Pose, wrap_angle
from perception.localization.drift import drift_correction, landmark_tracker
from perception.localization.drift.drift_correction import (
    FAILURES_MAX,
    LONGEST_WAY_M,
    WAITING_MAX,
    DriftCorrection,
    SeenObject,
)
from perception.localization.drift.landmark_state import ODOMETER
from perception.localization.drift.map_heading import ENTERED_AT_ONCE

RING = load_settings(None).ring
MOUNTS = np.array(RING.mounts)
RADIUS_M = 0.3
PLACES = ((2.0, 1.2), (0.8, -1.3), (3.0, -1.4), (4.2, 1.3))
SEEN = [SeenObject(k + 1, x, y, RADIUS_M) for k, (x, y) in enumerate(PLACES)]


def ranges_at(x: float, y: float, yaw: float, sensors: range) -> np.ndarray:
    """Return exact ranges at a true pose."""
    found = np.full(len(MOUNTS), np.nan)
    for i in sensors:
        mx, my, axis = MOUNTS[i]
        c, s = math.cos(yaw), math.sin(yaw)
        best = math.inf
        for px, py in PLACES:
            dx, dy = px - (x + c * mx - s * my), py - (y + s * mx + c * my)
            off = (math.atan2(dy, dx) - yaw - axis + math.pi) % (2 * math.pi) - math.pi
            if abs(off) < math.radians(RING.beam_half_angle_deg):
                best = min(best, math.hypot(dx, dy) - RADIUS_M)
        found[i] = best
    return found


def firing(k: int, scale: float = 1.0, step: float = 0.03) -> Firing:
    """Return the k-th firing of a straight drive with this odometer scale."""
    ranges = ranges_at(step * k, 0.0, 0.0, range(k % 3, len(MOUNTS), 3))
    return Firing(0.1 * k, Pose(scale * step * k, 0.0, 0.0), 0.0, ranges)


def test_before_the_first_landmarks_the_pose_is_odometrys() -> None:
    drift = DriftCorrection(RING)
    assert drift.localized().status == "localizing"
    for k in range(5):
        drift.observe(firing(k, 1.02))
    assert drift.localized().pose == firing(4, 1.02).pose
    assert drift.corrected(firing(4, 1.02)).pose == firing(4, 1.02).pose
    assert drift.localized().status == "localizing"


def test_the_filter_begins_at_the_first_firing_and_catches_up() -> None:
    drift = DriftCorrection(RING)
    for k in range(40):
        drift.observe(firing(k))
    drift.learn(SEEN[:2])
    assert drift.e[0].count == 0
    drift.learn(SEEN[:3])
    assert (drift.e[0].count, drift.e[0].x) == (3, 0.0)
    k = 40
    while drift.localized().status == "localizing":
        drift.observe(firing(k))
        k += 1
    assert k == 40 + math.ceil(39 / (ENTERED_AT_ONCE - 1))
    assert drift.localized().status == "tracking"
    assert drift.localized().pose.x == pytest.approx(firing(k - 1).pose.x, abs=0.01)


def test_the_first_landmarks_share_an_error_of_the_heading() -> None:
    drift = DriftCorrection(RING)
    for k in range(40):
        drift.observe(firing(k))
    drift.learn(SEEN)
    way = firing(39).pose.x
    for seen in SEEN:
        xx, _, yy = drift.places()[seen.number].covariance
        shared = drift.heading_walk**2 * way * ((seen.x - way) ** 2 + seen.y**2)
        assert xx + yy == pytest.approx(2.0 * drift_correction.FIRST_LANDMARK_SIGMA_M**2 + shared)


@pytest.mark.compiled
def test_scale_errors_of_the_odometer_are_found_and_corrected() -> None:
    drift = DriftCorrection(RING)
    drift._evidence.is_refuted = True
    for k in range(150):
        drift.observe(firing(k, 1.03))
        if k >= 20:
            drift.learn(SEEN)
    here = drift.localized()
    assert here.status == "tracking"
    assert here.probability > 0.9
    assert (here.pose.x, here.pose.y) == pytest.approx((0.03 * 149, 0.0), abs=0.03)
    assert drift.e[0].odometer_scale == pytest.approx(1.03, abs=0.01)
    assert drift.covariance[ODOMETER, ODOMETER] < 0.01**2
    assert np.linalg.eigvalsh(here.covariance).min() > 0.0
    place = drift.places().get(1)
    assert place is not None
    assert (place.x, place.y) == pytest.approx(PLACES[0], abs=0.03)
    assert drift.places().get(99) is None


def test_a_landmark_that_is_no_longer_recognised_is_dropped() -> None:
    drift = DriftCorrection(RING)
    drift.observe(firing(0))
    drift.learn(SEEN)
    drift.learn(SEEN[1:])
    assert drift.places().get(1) is None
    assert drift.places().get(2) is not None


def test_a_landmark_beyond_the_sensors_range_stays_though_perception_has_archived_it() -> None:
    drift = DriftCorrection(RING)
    drift.observe(firing(0))
    drift.learn([*SEEN, SeenObject(9, RING.range_max_m + 1.0, 0.0, RADIUS_M)])
    drift.learn(SEEN)
    assert drift.places().get(9) is not None


def test_a_landmark_that_moved_is_placed_anew_and_the_others_are_kept() -> None:
    drift = DriftCorrection(RING)
    drift.observe(firing(0))
    drift.learn(SEEN)
    before = drift.places().get(2)
    drift.e[0].landmarks[0].failures = FAILURES_MAX
    drift.learn([SEEN[0]._replace(x=2.5), *SEEN[1:]])
    moved = drift.places().get(1)
    assert moved is not None
    assert moved.x == pytest.approx(2.5)
    assert moved.covariance[0] == pytest.approx(drift_correction.MOVED_SIGMA_M**2)
    assert drift.places().get(2) == before


def test_while_no_echo_fits_odometry_is_trusted_less_and_the_robot_is_lost() -> None:
    drift = DriftCorrection(RING)
    drift.observe(firing(0))
    drift.learn(SEEN)
    drift.e[0].fit_share = 0.2
    wide = drift.localized().covariance[0, 0]
    drift.observe(Firing(0.1, Pose(0.03, 0.0, 0.0), 0.0, np.full(len(MOUNTS), np.nan)))
    assert drift.localized().status == "lost"
    assert drift.localized().covariance[0, 0] > wide + 0.9 * landmark_tracker.SLIP_M**2


def test_firings_wait_no_longer_than_there_is_room() -> None:
    drift = DriftCorrection(RING)
    silent = np.full(len(MOUNTS), np.nan)
    for k in range(WAITING_MAX + 30):
        drift.observe(Firing(0.1 * k, Pose(1e-3 * k, 0.0, 0.0), 0.0, silent))
    assert drift.localized().pose.x == pytest.approx(1e-3 * (WAITING_MAX + 29))


def test_without_any_landmark_the_filter_follows_odometry_after_a_while() -> None:
    drift = DriftCorrection(RING)
    silent = np.full(len(MOUNTS), np.nan)
    for k in range(100):
        drift.observe(Firing(0.1 * k, Pose(0.1 * k, 0.0, 0.01 * k), 0.01 * k, silent))
    assert LONGEST_WAY_M < 0.1 * 99
    here = drift.localized()
    assert (here.pose.x, here.pose.theta) == pytest.approx((9.9, 0.99), abs=1e-9)
    assert here.covariance[2, 2] > 0.0


def test_a_log_may_wrap_its_headings() -> None:
    drift, wrapped = DriftCorrection(RING), DriftCorrection(RING)
    silent = np.full(len(MOUNTS), np.nan)
    for k in range(120):
        theta = 0.06 * k
        shown = wrap_angle(theta)
        drift.observe(Firing(0.1 * k, Pose(0.1 * k, 0.0, theta), theta, silent))
        wrapped.observe(Firing(0.1 * k, Pose(0.1 * k, 0.0, shown), shown, silent))
    turn = wrap_angle(wrapped.localized().pose.theta - drift.localized().pose.theta)
    assert turn == pytest.approx(0.0, abs=1e-9)
    assert wrapped.localized().covariance == pytest.approx(drift.localized().covariance, abs=1e-9)


def test_a_synchro_drives_ring_keeps_its_direction() -> None:
    drift = DriftCorrection(RING)
    silent = np.full(len(MOUNTS), np.nan)
    for k in range(100):
        drift.observe(Firing(0.1 * k, Pose(0.1 * k, 0.0, 0.01 * k), 0.0, silent))
    here = drift.localized()
    assert here.ring_yaw == 0.0
    assert here.pose.theta == pytest.approx(0.99)


def test_landmarks_that_moved_are_yielded_once() -> None:
    drift = DriftCorrection(RING)
    drift.observe(firing(0))
    drift.learn(SEEN)
    drift.e[0].landmarks[1].x += 0.01
    assert [(number, round(dx, 6), dy) for number, dx, dy in drift.moved_landmarks(0.002, {1, 2})] == [(2, 0.01, 0.0)]
    assert drift.moved_landmarks(0.002, {1, 2}) == []
    drift.e[0].landmarks[1].x += 0.01
    assert drift.moved_landmarks(0.002, {1}) == []


def test_a_reset_forgets_everything() -> None:
    drift = DriftCorrection(RING)
    drift.observe(firing(0))
    drift.learn(SEEN)
    drift.reset()
    assert drift.e[0].count == 0
    drift.observe(Firing(0.0, Pose(5.0, 1.0, 0.3), 0.3, np.full(len(MOUNTS), np.nan)))
    assert drift.localized().pose == Pose(5.0, 1.0, 0.3)
