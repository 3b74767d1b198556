"""Ranges as measurements of the landmark filter: association, gates, the beam's edge, consistency and scales."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.localization.drift import landmark_ranges as kernels
from perception.localization.drift.landmark_association import is_landmark_hidden
from perception.localization.drift.landmark_filter import add_landmark, propagate
from perception.localization.drift.landmark_state import (
    FIRST,
    HEADING,
    ODOMETER,
    OFFSET,
    RANGE,
    ROWS_MAX,
    TURN,
    Estimate,
    SonarModel,
    X,
    Y,
)
from perception.records import Records, records, zeros
from perception.shared_numbers import NO_INDEX
from tests.naive_landmarks import Array

HALF_ANGLE = math.radians(12.0)
RADIUS_M = 0.3
SIGMA_M = 0.01
VARIANCES = (SIGMA_M**2, 0.0)
RANGE_MAX_M = 7.0
MOUNTS = np.array([[0.4 * math.cos(a), 0.4 * math.sin(a), a] for a in np.arange(24) * math.radians(15.0)])
AHEAD = (0.4, 0.0, 0.0)
"""The mount of a sensor that looks ahead."""


def new_filter(landmarks: list[tuple[float, float]], sigma: float = 0.02) -> tuple[Records[Estimate], Array]:
    """Return a filter at the origin, with landmarks of this standard deviation (m)."""
    e, covariance = records(Estimate, zeros(Estimate, 1)), np.zeros((ROWS_MAX, ROWS_MAX))
    e[0].odometer_scale = e[0].range_scale = e[0].noise = e[0].fit_share = 1.0
    for x, y in landmarks:
        i = add_landmark(e, covariance, x, y, sigma**2, 0.0, sigma**2)
        e[0].landmarks[i].radius = RADIUS_M
    return e, covariance


def enter(e: Records[Estimate], covariance: Array, r: float) -> int:
    """Enter a range of the sensor that looks ahead."""
    return kernels.update_with_range(e, covariance, AHEAD, r, SonarModel(*VARIANCES, HALF_ANGLE, 0.2, RANGE_MAX_M))


def test_a_reading_is_from_the_landmark_it_fits() -> None:
    e, covariance = new_filter([(2.0, 0.0), (3.5, 0.1), (0.0, 2.0)])
    assert enter(e, covariance, 2.0 - 0.4 - RADIUS_M) == 0
    assert enter(e, covariance, 3.5 - 0.4 - RADIUS_M) == 1
    assert enter(e, covariance, 2.4) == NO_INDEX
    assert enter(e, covariance, math.inf) == NO_INDEX


def test_a_reading_that_two_landmarks_explain_is_not_used() -> None:
    e, covariance = new_filter([(2.0, 0.1), (2.0, -0.1)])
    before = covariance.copy()
    assert enter(e, covariance, 1.3) == NO_INDEX
    np.testing.assert_array_equal(covariance, before)


def test_a_landmark_that_moved_fails_again_and_again() -> None:
    e, covariance = new_filter([(2.0, 0.0)])
    for k in range(3):
        enter(e, covariance, 1.1)
        assert e[0].landmarks[0].failures == k + 1
    enter(e, covariance, 1.3)
    assert e[0].landmarks[0].failures == 0


def test_the_share_of_expected_echoes_falls_while_they_fail_to_come() -> None:
    e, covariance = new_filter([(2.0, 0.0)])
    for _ in range(100):
        enter(e, covariance, 4.0)
    assert e[0].fit_share < 0.1


def test_a_landmark_that_something_hides_is_not_expected() -> None:
    e, covariance = new_filter([(2.0, 0.0)])
    for _ in range(100):
        enter(e, covariance, 0.6)
    assert e[0].fit_share == 1.0


@pytest.mark.parametrize(("is_heard", "side"), [(True, 1.0), (True, -1.0), (False, 1.0), (False, -1.0)])
def test_an_echo_at_the_edge_of_the_beam_moves_the_landmark_in_and_silence_out(is_heard: bool, side: float) -> None:
    off = side * HALF_ANGLE
    e, covariance = new_filter([(0.4 + 2.0 * math.cos(off), 2.0 * math.sin(off))], sigma=0.05)
    r = 2.0 - RADIUS_M if is_heard else math.inf
    assert enter(e, covariance, r) == (0 if is_heard else NO_INDEX)
    at = e[0].landmarks[0]
    bearing = math.atan2(at.y - e[0].y, at.x - e[0].x - 0.4)
    assert (abs(bearing) < HALF_ANGLE) == is_heard
    assert abs(abs(bearing) - HALF_ANGLE) < math.radians(1.5)


def test_a_reading_that_may_be_a_wild_one_says_less_of_the_bearing() -> None:
    off, bearings = HALF_ANGLE + math.radians(1.5), []
    for stray in (0.0, 0.02, 30.0):
        e, covariance = new_filter([(0.4 + 2.0 * math.cos(off), 2.0 * math.sin(off))], sigma=0.04)
        kernels.update_with_edge(e, covariance, 0, *AHEAD, HALF_ANGLE, stray)
        at = e[0].landmarks[0]
        bearings.append(math.atan2(at.y - e[0].y, at.x - e[0].x - 0.4))
    assert bearings[0] < bearings[1] < bearings[2]
    assert bearings[2] == pytest.approx(off, abs=math.radians(0.01))


def test_a_landmark_that_is_heard_from_far_outside_the_beam_as_predicted_is_taken_back_into_it() -> None:
    off = HALF_ANGLE + math.radians(4.0)
    e, covariance = new_filter([(0.4 + 2.0 * math.cos(off), 2.0 * math.sin(off))], sigma=0.04)
    kernels.update_with_edge(e, covariance, 0, *AHEAD, HALF_ANGLE, 1e-5)
    at = e[0].landmarks[0]
    bearing = math.atan2(at.y - e[0].y, at.x - e[0].x - 0.4)
    assert off - bearing > math.radians(4.0)


def test_the_worse_a_range_fits_the_more_it_may_be_a_wild_one() -> None:
    off, shrunk = HALF_ANGLE + math.radians(1.5), []
    across = np.array([-math.sin(off), math.cos(off)])
    for wrong in (0.0, 3.0):
        e, covariance = new_filter([(0.4 + 2.0 * math.cos(off), 2.0 * math.sin(off))], sigma=0.04)
        enter(e, covariance, 2.0 - RADIUS_M + wrong * math.hypot(SIGMA_M, 0.04))
        shrunk.append(float(across @ covariance[FIRST : FIRST + 2, FIRST : FIRST + 2] @ across))
    assert shrunk[0] < 0.04**2 < shrunk[1]  # either cause may be: the bearing is less certain than before


def test_a_landmark_that_is_uncertain_across_the_line_of_sight_is_farther_than_its_mean() -> None:
    e, covariance = new_filter([(2.4, 0.0)], sigma=0.1)
    covariance[FIRST, FIRST] = 1e-8
    sideways = 0.1 * np.random.default_rng(1).standard_normal(200_000)
    mean = float(np.mean(np.hypot(2.0, sideways))) - RADIUS_M
    before = e[0].range_scale
    covariance[RANGE, RANGE] = 1e-4
    enter(e, covariance, mean)
    assert e[0].range_scale == pytest.approx(before, abs=2e-5)


def test_a_range_that_is_short_by_chance_counts_no_more_than_a_long_one() -> None:
    found = []
    for sign in (1.0, -1.0):
        e, covariance = new_filter([(2.4, 0.0)], sigma=1e-5)
        covariance[RANGE, RANGE] = 1e-4
        sonar = SonarModel(1e-6, 0.05**2, HALF_ANGLE, 0.2, RANGE_MAX_M)
        kernels.update_with_range(e, covariance, AHEAD, (2.0 - RADIUS_M) * (1.0 + 0.05 * sign), sonar)
        found.append(e[0].range_scale - 1.0)
    assert found[0] == pytest.approx(-found[1], rel=1e-3)


@pytest.mark.parametrize("is_heard", [True, False])
def test_how_often_landmarks_outside_the_beam_are_heard_is_found(is_heard: bool) -> None:
    off = HALF_ANGLE + math.radians(0.8)
    e, covariance = new_filter([(0.4 + 2.0 * math.cos(off), 2.0 * math.sin(off))], sigma=0.002)
    e[0].stray = kernels.STRAY
    before = covariance.copy()
    for _ in range(120):
        covariance[:] = before
        enter(e, covariance, 2.0 - RADIUS_M if is_heard else math.inf)
    assert (e[0].stray > 0.5) if is_heard else (e[0].stray < 0.2 * kernels.STRAY)


def test_a_landmark_inside_the_beam_says_nothing_of_those_outside() -> None:
    e, covariance = new_filter([(2.4, 0.05)], sigma=0.002)
    e[0].stray = kernels.STRAY
    for r in (1.7, math.inf, 1.7, math.inf):
        enter(e, covariance, r)
    assert e[0].stray == pytest.approx(kernels.STRAY)


def test_where_landmarks_outside_are_heard_an_echo_does_not_turn_the_ring() -> None:
    off, turned = HALF_ANGLE + math.radians(1.5), []
    for stray in (0.001, 0.8):
        e, covariance = new_filter([(0.4 + 2.0 * math.cos(off), 2.0 * math.sin(off))], sigma=0.04)
        e[0].stray = stray
        enter(e, covariance, 2.0 - RADIUS_M)
        at = e[0].landmarks[0]
        turned.append(off - math.atan2(at.y - e[0].y, at.x - e[0].x - 0.4))
    assert turned[0] > math.radians(1.0) > 3.0 * turned[1]


@pytest.mark.parametrize("stray", [0.0005, 0.3, 0.8])
@pytest.mark.parametrize("is_heard", [True, False])
@pytest.mark.parametrize("outside_deg", [-0.5, 0.3, 0.8])
def test_the_bearing_has_the_moments_of_the_exact_posterior(is_heard: bool, stray: float, outside_deg: float) -> None:
    d, sigma = 2.0, math.radians(0.6)
    off = HALF_ANGLE + math.radians(outside_deg)
    e, covariance = new_filter([(0.4 + d * math.cos(off), d * math.sin(off))], sigma=d * sigma)
    e[0].stray = stray
    kernels.update_with_edge(e, covariance, 0, *AHEAD, HALF_ANGLE, 0.0 if is_heard else kernels.NO_RANGE)
    at, across = e[0].landmarks[0], np.array([-math.sin(off), math.cos(off)])
    found = across @ (at.x - 0.4 - d * math.cos(off), at.y - d * math.sin(off)) / d
    variance = across @ covariance[FIRST : FIRST + 2, FIRST : FIRST + 2] @ across / d**2
    bearings = off + sigma * np.linspace(-6.0, 6.0, 4001)
    inside = [0.5 * math.erfc((b - HALF_ANGLE) / (math.sqrt(2.0) * kernels.EDGE_RAD)) for b in bearings.tolist()]
    heard = stray + (1.0 - stray) * np.array(inside)
    weights = np.exp(-0.5 * ((bearings - off) / sigma) ** 2)
    weights *= heard if is_heard else 1.0 - (1.0 - kernels.DROP_OUT) * heard
    mean = np.average(bearings, weights=weights)
    assert found == pytest.approx(mean - off, abs=0.01 * sigma)
    assert variance == pytest.approx(np.average((bearings - mean) ** 2, weights=weights), rel=0.02)


def test_a_range_of_a_farther_landmark_says_that_the_nearer_one_is_outside_the_beam() -> None:
    off = HALF_ANGLE - math.radians(1.0)
    near = (0.4 + 1.5 * math.cos(off), 1.5 * math.sin(off))
    e, covariance = new_filter([near, (3.5, -0.4)], sigma=0.04)
    assert enter(e, covariance, math.hypot(3.1, 0.4) - RADIUS_M) == 1
    at = e[0].landmarks[0]
    assert math.atan2(at.y - e[0].y, at.x - e[0].x - 0.4) > HALF_ANGLE


@pytest.mark.parametrize(("sigma", "is_heard"), [(0.01, False), (0.08, True)])
def test_a_landmark_outside_the_beam_may_answer_if_its_bearing_is_uncertain(sigma: float, is_heard: bool) -> None:
    off = HALF_ANGLE + math.radians(4.0)
    e, covariance = new_filter([(0.4 + 2.0 * math.cos(off), 2.0 * math.sin(off))], sigma)
    assert enter(e, covariance, 2.0 - RADIUS_M) == (0 if is_heard else NO_INDEX)


def test_landmarks_at_hardly_known_places_do_not_change_the_estimate_of_the_noise() -> None:
    e, covariance = new_filter([(2.0, 0.0)], sigma=0.1)
    for _ in range(3):
        covariance[FIRST, FIRST] = covariance[FIRST + 1, FIRST + 1] = 0.1**2
        enter(e, covariance, 1.3)
    assert e[0].noise == pytest.approx(1.0, abs=1e-3)


def test_a_hidden_landmark_is_not_missed() -> None:
    near, far = (1.1, 0.33), (3.0, 0.62)
    e, covariance = new_filter([far, near])
    assert is_landmark_hidden(e, 0, 0.4, 0.0)
    assert not is_landmark_hidden(e, 1, 0.4, 0.0)
    before = covariance.copy()
    assert enter(e, covariance, math.inf) == NO_INDEX
    np.testing.assert_array_equal(covariance[FIRST : FIRST + 2], before[FIRST : FIRST + 2])


def test_a_sensor_that_stands_still_is_used_once() -> None:
    e, covariance = new_filter([(2.0, 0.0)])
    ranges = np.full(len(MOUNTS), np.nan)
    ranges[0] = 1.3
    args = (0.0, 0.0, 0.0), SonarModel(*VARIANCES, HALF_ANGLE, 0.2, RANGE_MAX_M)
    used = [kernels.update_with_firing(e, covariance, MOUNTS, ranges, *args) for _ in range(5)]
    assert used == [1, 0, 0, 0, 0]


def circle_run(seed: int, steps: int) -> tuple[Records[Estimate], Array, dict[str, float]]:
    """Drive circles among six landmarks with wrong scales; return the filter and the truth at the end."""
    rng = np.random.default_rng(seed)
    places = np.array([[2.2, 0.3], [1.0, 2.1], [-1.2, 1.9], [-2.0, -0.4], [-0.9, -2.2], [1.3, -1.8]])
    sigmas = {OFFSET: 0.01, ODOMETER: 0.03, TURN: 0.01, RANGE: 0.01}
    offset, odometer, turn_scale, range_scale = (mean + sigma * rng.standard_normal() for mean, sigma in
                                                 zip((0.0, 1.0, 0.0, 1.0), sigmas.values(), strict=True))  # fmt: skip
    e, covariance = new_filter([])
    for row, sigma in sigmas.items():
        covariance[row, row] = sigma**2
    x, y, heading = 1.0, 0.0, 0.5 * math.pi
    e[0].x, e[0].y, e[0].heading = x, y, heading
    for place in places + 0.06 * rng.standard_normal(places.shape):
        i = add_landmark(e, covariance, place[1], 1.0 - place[0], 0.06**2, 0.0, 0.06**2)
        e[0].landmarks[i].radius = RADIUS_M
    step, walk, slip = 0.05, math.radians(0.5) ** 2, 0.002**2
    for k in range(steps):
        turn = step + math.sqrt(walk * step) * rng.standard_normal()
        moved = step * np.array([math.cos(heading + offset), math.sin(heading + offset)])
        x, y = np.array([x, y]) + moved + math.sqrt(slip * step) * rng.standard_normal(2)
        heading += turn
        reported = step / (1.0 + turn_scale)
        propagate(e, covariance, step * odometer, 0.0, 0.0, reported, reported, (walk * step, 0.0, slip * step))
        ranges = np.full(len(MOUNTS), np.nan)
        for i in range(k % 3, len(MOUNTS), 3):
            mx, my, axis = MOUNTS[i]
            c, s = math.cos(heading), math.sin(heading)
            sight = places - (x + c * mx - s * my, y + s * mx + c * my)
            d = np.hypot(*sight.T)
            off = np.abs((np.arctan2(sight[:, 1], sight[:, 0]) - heading - axis + math.pi) % (2 * math.pi) - math.pi)
            heard = d[off < HALF_ANGLE]
            ranges[i] = (
                range_scale * (heard.min() - RADIUS_M) + SIGMA_M * rng.standard_normal() if len(heard) else math.inf
            )
        sonar = SonarModel(*VARIANCES, HALF_ANGLE, 0.05, RANGE_MAX_M)
        kernels.update_with_firing(e, covariance, MOUNTS, ranges, (e[0].x, e[0].y, e[0].heading), sonar)
    truth = {"x": x, "y": y, "heading": heading, "odometer": odometer, "range": range_scale}
    return e, covariance, truth


def pose_nees(e: Records[Estimate], covariance: Array, truth: dict[str, float]) -> float:
    """Return the normalised squared error of the pose, three degrees of freedom."""
    est = e[0]
    to = np.array([[-est.y, 1.0, 0.0], [est.x, 0.0, 1.0], [1.0, 0.0, 0.0]])
    p = to @ covariance[np.ix_([HEADING, X, Y], [HEADING, X, Y])] @ to.T
    off = np.array([truth["x"] - est.x, truth["y"] - est.y, truth["heading"] - est.heading])
    return float(off @ np.linalg.solve(p, off))


@pytest.mark.compiled
def test_the_pose_is_as_uncertain_as_it_is_wrong() -> None:
    """The mean NEES of 20 drives is within the 99.9 % band of its χ²; no value was chosen on these drives."""
    found = [pose_nees(*circle_run(seed, 120)) for seed in range(20)]
    assert 1.4 < np.mean(found) < 5.1


@pytest.mark.compiled
def test_scales_are_recovered() -> None:
    e, covariance, truth = circle_run(3, 600)
    for row, found, true in (
        (ODOMETER, e[0].odometer_scale, truth["odometer"]),
        (RANGE, e[0].range_scale, truth["range"]),
    ):
        sigma = math.sqrt(covariance[row, row])
        assert sigma < 0.005
        assert abs(found - true) < 3.0 * sigma
