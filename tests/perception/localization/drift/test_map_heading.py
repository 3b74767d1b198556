"""Where the map lies, found again: its algebra against whole matrices, and maps that were moved on purpose."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_settings
from drivers.messages import Firing, Pose
from perception.localization.drift.drift_correction import (
    FAILURES_MAX,
    SHIFT_PER_M,
    TURN_PER_M,
    DriftCorrection,
    SeenObject,
)
from perception.localization.drift.landmark_state import FIRST, HEADING, X, Y
from perception.localization.drift.map_heading import (
    BEGIN_M,
    FIRST_FIRINGS,
    MapHeading,
    fit_of_motion,
    motion_between,
    place_errors,
    rows_of,
    without_motion,
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


def move_filter(drift: DriftCorrection, turn: float, dx: float, dy: float) -> None:
    """Turn the filter's map and pose about the start, and shift them."""
    e = drift.e[0]
    to = Pose(START[0] + dx, START[1] + dy, turn).compose(Pose(-START[0], -START[1], 0.0))
    ring = to.compose(Pose(e.x, e.y, e.heading))
    e.x, e.y, e.heading = ring.x, ring.y, ring.theta
    for i in range(e.count):
        place = to.compose(Pose(e.landmarks[i].x, e.landmarks[i].y, 0.0))
        e.landmarks[i].x, e.landmarks[i].y = place.x, place.y


def test_a_landmark_that_errs_as_the_ring_does_turns_about_the_origin() -> None:
    landmarks = np.random.default_rng(1).uniform(-3.0, 3.0, (5, 2))
    errors = place_errors(landmarks)
    small = 1e-6
    turned = landmarks @ np.array([[1.0, small], [-small, 1.0]])
    np.testing.assert_allclose(errors[:, HEADING] * small, (turned - landmarks).ravel())
    row = np.zeros(errors.shape[1])
    row[FIRST + 3] = 0.2
    assert (errors @ row).tolist() == [0.0, 0.0, 0.0, 0.2] + [0.0] * 6
    np.testing.assert_array_equal(rows_of(errors, [3, 1]), errors[[6, 7, 2, 3]])


def test_a_turn_about_the_start_leaves_a_place_there_and_a_shift_moves_all() -> None:
    heading = MapHeading(RING)
    heading.start_x, heading.start_y = START
    landmarks = np.array([START, (START[0] + 2.0, START[1] + 1.0)])
    moving = heading._moving(landmarks)
    np.testing.assert_allclose(
        place_errors(landmarks) @ moving,
        [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 1.0, 0.0], [2.0, 0.0, 1.0]], atol=1e-12,
    )  # fmt: skip
    assert moving[X].tolist() == [START[1], 1.0, 0.0]
    assert moving[Y].tolist() == [-START[0], 0.0, 1.0]


def test_the_motion_is_taken_out_of_the_covariance_and_what_is_left_is_independent_of_it() -> None:
    rng = np.random.default_rng(2)
    heading = MapHeading(RING)
    heading.start_x, heading.start_y = START
    landmarks = rng.uniform(-3.0, 3.0, (4, 2))
    moving, of_places = heading._moving(landmarks), place_errors(landmarks)
    n = len(moving)
    root = rng.standard_normal((n, n))
    covariance = root @ root.T
    of_each, variance = fit_of_motion(of_places @ covariance @ of_places.T, of_places @ moving)
    weights = of_places.T @ of_each
    np.testing.assert_allclose(weights.T @ moving, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(weights.T @ covariance @ weights, variance, atol=1e-9)
    out = np.eye(n) - moving @ weights.T
    left = without_motion(covariance, weights, moving)
    np.testing.assert_allclose(left, out @ covariance @ out.T, atol=1e-9)
    np.testing.assert_allclose(of_places @ out @ covariance @ weights, 0.0, atol=1e-9)


def test_the_motion_between_two_sets_of_places() -> None:
    places = np.random.default_rng(3).uniform(-3.0, 3.0, (4, 2))
    moving = np.zeros((8, 3))
    moving[:, 0] = np.column_stack([-places[:, 1], places[:, 0]]).ravel()
    moving[::2, 1] = moving[1::2, 2] = 1.0
    weights, _ = fit_of_motion(np.eye(8), moving)
    c, s = math.cos(0.1), math.sin(0.1)
    after = places @ np.array([[c, s], [-s, c]]) + (0.05, -0.02)
    np.testing.assert_allclose(motion_between(places, after, weights), (0.1, 0.05, -0.02), atol=1e-6)


@pytest.mark.compiled
@pytest.mark.parametrize(
    ("turn", "dx", "dy"),
    [(math.radians(-1.0), 0.0, 0.0), (math.radians(1.0), 0.0, 0.0), (0.0, 0.03, 0.0), (0.0, 0.0, -0.03)],
)
def test_a_map_that_was_moved_is_moved_back_without_a_jump(
    turn: float, dx: float, dy: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Odometry is exact here, which the correction would find: what is tested is the motion of the map."""
    monkeypatch.setattr(DriftCorrection, "is_applied", True)
    drift = DriftCorrection(RING)
    drift.observe(firing(0))
    drift.learn(SEEN)
    count = round((BEGIN_M + 3.0) / STEP_M)
    frames, held = [], []
    for k in range(1, count):
        if k == 20:
            move_filter(drift, turn, dx, dy)
        drift.observe(firing(k))
        frames.append(drift.map_from_filter())
        held.append(drift.odometry_from_filter().theta)
    assert held[-1] == pytest.approx(-turn, abs=math.radians(0.3)), "what perception holds stays turned"
    assert frames[-1].theta == pytest.approx(-turn, abs=math.radians(0.3))
    at_start = np.array([(at.x, at.y) for at in (frame.compose(Pose(*START, 0.0)) for frame in frames)])
    np.testing.assert_allclose(at_start[-1] - START, (-dx, -dy), atol=0.005)
    assert np.abs(np.diff([frame.theta for frame in frames])).max() <= TURN_PER_M * STEP_M + 1e-12
    assert np.abs(np.diff(at_start, axis=0)).max() <= SHIFT_PER_M * STEP_M + 1e-12
    here, true = drift.localized(), firing(count - 1).pose
    assert here.pose.theta == pytest.approx(0.0, abs=math.radians(0.3))
    assert (here.pose.x, here.pose.y) == pytest.approx((true.x, true.y), abs=0.06 if turn else 0.02)
    assert abs(here.pose.theta) < 3.0 * math.sqrt(here.covariance[2, 2])
    to = drift.odometry_from_map()
    assert {type(v) for v in (here.pose.x, here.pose.theta, here.ring_yaw, to.x, to.theta)} == {float}
    assert drift.odometry_from_map().theta == pytest.approx(0.0, abs=math.radians(0.3))


@pytest.mark.compiled
def test_a_landmark_that_moved_says_nothing_of_where_the_map_lies() -> None:
    drift = DriftCorrection(RING)
    drift.observe(firing(0))
    drift.learn(SEEN)
    landmark = drift.e[0].landmarks[2]
    landmark.failures = FAILURES_MAX
    drift.learn(SEEN)
    for k in range(1, round((BEGIN_M + 1.0) / STEP_M)):
        drift.observe(firing(k))
    (numbers,), (entered,) = drift._tracker.landmarks("number"), drift._map_heading._tracker.landmarks("number")
    assert set(numbers) - set(entered) == {3}


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
