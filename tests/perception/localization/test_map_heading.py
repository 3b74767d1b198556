"""The heading of the map found again: its algebra against whole matrices, and maps that were turned on purpose."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_settings
from drivers.messages import Firing, Pose
from perception.localization.drift_correction import TURN_PER_M, DriftCorrection, SeenObject
from perception.localization.landmark_state import FIRST, HEADING, X, Y
from perception.localization.map_heading import (
    BEGIN_M,
    FIRST_FIRINGS,
    MapHeading,
    fit_of_heading,
    turn_between,
    without_heading,
)

RING = load_settings(None).ring
MOUNTS = np.array(RING.mounts)
RADIUS_M = 0.3
PLACES = [(0.9 * k + 0.3 * (k % 3), side * (1.2 + 0.2 * (k % 2))) for k in range(16) for side in (-1, 1)]
SEEN = [SeenObject(k + 1, x, y, RADIUS_M) for k, (x, y) in enumerate(PLACES)]
STEP_M = 0.05
START = (1.0, 0.3)


def firing(k: int) -> Firing:
    """Return the k-th firing of a straight drive among the landmarks, with exact odometry and ranges."""
    x, y = START[0] + STEP_M * k, START[1]
    ranges = np.full(len(MOUNTS), np.nan)
    for i in range(k % 3, len(MOUNTS), 3):
        mx, my, axis = MOUNTS[i]
        sight = np.array(PLACES) - (x + mx, y + my)
        off = (np.arctan2(sight[:, 1], sight[:, 0]) - axis + math.pi) % (2 * math.pi) - math.pi
        heard = np.hypot(*sight.T)[np.abs(off) < math.radians(RING.beam_half_angle_deg)]
        ranges[i] = heard.min() - RADIUS_M if len(heard) else math.inf
    return Firing(0.1 * k, Pose(x, y, 0.0), 0.0, ranges)


def turn_filter(drift: DriftCorrection, turn: float) -> None:
    """Turn the filter's map and pose about the start."""
    e, c, s = drift.e[0], math.cos(turn), math.sin(turn)
    dx, dy = e.x - START[0], e.y - START[1]
    e.x, e.y = START[0] + c * dx - s * dy, START[1] + s * dx + c * dy
    for i in range(e.count):
        landmark = e.landmarks[i]
        dx, dy = landmark.x - START[0], landmark.y - START[1]
        landmark.x, landmark.y = START[0] + c * dx - s * dy, START[1] + s * dx + c * dy
    e.heading += turn


def test_the_fit_finds_a_turn_about_the_start_and_ignores_a_shift() -> None:
    landmarks = np.random.default_rng(1).uniform(-3.0, 3.0, (5, 2))
    fit = fit_of_heading(landmarks)
    shift = np.zeros(len(fit))
    shift[X], shift[Y] = 0.3, -0.2
    shift[FIRST::2], shift[FIRST + 1 :: 2] = 0.3, -0.2
    turn = shift.copy()
    turn[HEADING] = 1.0
    assert fit @ shift == pytest.approx(0.0)
    assert fit @ turn == pytest.approx(1.0)
    relative = np.zeros(len(fit))
    relative[FIRST:] = np.column_stack([-landmarks[:, 1], landmarks[:, 0]]).ravel()
    assert fit @ relative == pytest.approx(1.0), "a map that turned while the ring did not"


def test_the_heading_is_taken_out_of_the_covariance() -> None:
    rng = np.random.default_rng(2)
    fit = fit_of_heading(rng.uniform(-3.0, 3.0, (4, 2)))
    n = len(fit)
    root, turning = rng.standard_normal((n, n)), np.zeros(n)
    turning[HEADING], turning[FIRST::2] = 1.0, 0.7
    out = np.eye(n) - np.outer(turning, fit)
    left = without_heading(root @ root.T, fit, turning)
    np.testing.assert_allclose(left, out @ root @ root.T @ out.T, atol=1e-9)
    assert fit @ left @ fit == pytest.approx(0.0, abs=1e-9)


def test_the_turn_between_two_sets_of_points() -> None:
    points = np.random.default_rng(3).uniform(-3.0, 3.0, (4, 2))
    c, s = math.cos(0.3), math.sin(0.3)
    assert turn_between(points, points @ np.array([[c, s], [-s, c]]) + (5.0, -2.0)) == pytest.approx(0.3)


@pytest.mark.compiled
@pytest.mark.parametrize("turn", [math.radians(-1.0), math.radians(1.0)])
def test_a_map_that_was_turned_is_turned_back_without_a_jump(turn: float) -> None:
    drift = DriftCorrection(RING)
    drift.observe(firing(0))
    drift.learn(SEEN)
    count = round((BEGIN_M + 3.0) / STEP_M)
    frames, held = [], []
    for k in range(1, count):
        if k == 20:
            turn_filter(drift, turn)
        drift.observe(firing(k))
        frames.append(drift.map_from_filter().theta)
        held.append(drift.odometry_from_filter().theta)
    assert held[-1] == pytest.approx(-turn, abs=math.radians(0.3)), "what perception holds stays turned"
    assert frames[-1] == pytest.approx(-turn, abs=math.radians(0.3))
    assert np.abs(np.diff(frames)).max() <= TURN_PER_M * STEP_M + 1e-12
    here, true = drift.localized(), firing(count - 1).pose
    assert here.pose.theta == pytest.approx(0.0, abs=math.radians(0.3))
    assert (here.pose.x, here.pose.y) == pytest.approx((true.x, true.y), abs=0.06)
    assert abs(here.pose.theta) < 3.0 * math.sqrt(here.covariance[2, 2])
    to = drift.odometry_from_map()
    assert {type(v) for v in (here.pose.x, here.pose.theta, here.ring_yaw, to.x, to.theta)} == {float}
    assert drift.odometry_from_map().theta == pytest.approx(0.0, abs=math.radians(0.3))


def test_only_firings_that_are_apart_are_kept_and_no_more_than_there_is_room_for() -> None:
    heading = MapHeading(RING)
    row = np.zeros(4 + len(MOUNTS))
    for _ in range(5):
        heading.keep(row)
    assert heading._kept == 1
    for k in range(2 * FIRST_FIRINGS):
        row[0] = 0.02 * k
        heading.keep(row)
    assert heading._kept == FIRST_FIRINGS
    assert (heading.start_x, heading.start_y) == (0.0, 0.0)


def test_the_ring_of_a_synchro_drive_keeps_its_direction_so_nothing_is_to_be_found() -> None:
    drift = DriftCorrection(RING)
    silent = np.full(len(MOUNTS), np.nan)
    drift.learn(SEEN)
    for k in range(60):
        drift.observe(Firing(0.1 * k, Pose(0.3 * k, 0.0, 0.01 * k), 0.0, silent))
    assert not drift._map_heading._is_entering
    assert drift.map_from_filter() == Pose(0.0, 0.0, 0.0)
