"""The kernels of the landmark filter against their oracle."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.localization.drift import landmark_filter as kernels
from perception.localization.drift.landmark_state import FIRST, LANDMARKS_MAX, RANGE, ROWS_MAX, Estimate
from perception.records import Records, records, zeros
from tests.naive_landmarks import Array, NaiveFilter

SIGMAS = (0.1, 0.2, 0.2, 0.02, 0.03, 0.02, 0.01)
"""Of heading, place, offset and the three scales at the start."""
STEPS = 40


def new_filter(rng: np.random.Generator) -> tuple[Records[Estimate], Array, NaiveFilter]:
    """Return the product's state and the oracle's, both with the same random correlated covariance."""
    e, covariance = records(Estimate, zeros(Estimate, 1)), np.zeros((ROWS_MAX, ROWS_MAX))
    root = np.diag(SIGMAS) @ (np.eye(FIRST) + 0.3 * rng.standard_normal((FIRST, FIRST)))
    covariance[:FIRST, :FIRST] = root @ root.T
    heading, x, y = 0.4, 1.5, -0.7
    e[0].heading, e[0].x, e[0].y = heading, x, y
    e[0].odometer_scale = e[0].range_scale = e[0].noise = 1.0
    return e, covariance, NaiveFilter(heading, np.array([x, y]), covariance[:FIRST, :FIRST].copy())


def mean_of(e: Records[Estimate]) -> list[float]:
    """Return all numbers of the mean, in the order of the covariance."""
    est = e[0]
    landmarks = [v for i in range(est.count) for v in (est.landmarks[i].x, est.landmarks[i].y)]
    return [est.heading, est.x, est.y, est.offset, est.odometer_scale, est.turn_scale, est.range_scale, *landmarks]


def naive_mean(naive: NaiveFilter) -> list[float]:
    """Return the same of the oracle."""
    slow = (naive.offset, naive.odometer_scale, naive.turn_scale, naive.range_scale)
    return [naive.heading, *naive.place, *slow, *(v for point in naive.landmarks for v in point)]


def assert_same(e: Records[Estimate], covariance: Array, naive: NaiveFilter) -> None:
    """Compare mean and covariance."""
    n = kernels.rows_used(e)
    assert mean_of(e) == pytest.approx(naive_mean(naive), abs=1e-9)
    np.testing.assert_allclose(covariance[:n, :n], naive.covariance, rtol=1e-7, atol=1e-12)


def add_both(
    rng: np.random.Generator, e: Records[Estimate], covariance: Array, naive: NaiveFilter
) -> None:  # fmt: skip
    """Add one landmark to both."""
    seen, root = rng.uniform(-3.0, 3.0, 2), 0.1 * rng.standard_normal((2, 2))
    noise = root @ root.T + 1e-3 * np.eye(2)
    at = kernels.add_landmark(e, covariance, seen[0], seen[1], noise[0, 0], noise[0, 1], noise[1, 1])
    assert at == len(naive.landmarks)
    naive.add(seen, noise)


def measure_both(
    rng: np.random.Generator, e: Records[Estimate], covariance: Array, naive: NaiveFilter
) -> None:  # fmt: skip
    """Enter one range into both."""
    est, i = e[0], int(rng.integers(e[0].count))
    mount, radius, variance = rng.uniform(-0.4, 0.4, 2), 0.3, 4e-4
    c, s = math.cos(est.heading), math.sin(est.heading)
    dx = est.landmarks[i].x - est.x - (c * mount[0] - s * mount[1])
    dy = est.landmarks[i].y - est.y - (s * mount[0] + c * mount[1])
    d = math.hypot(dx, dy)
    measured = est.range_scale * (d - radius) + 0.02 * float(rng.standard_normal())
    u, v = est.range_scale * dx / d, est.range_scale * dy / d
    n = kernels.rows_used(e)
    spread = kernels.innovation_variance(covariance, n, FIRST + 2 * i, u, v, d - radius, est.gain)
    kernels.correct(e, covariance, measured - est.range_scale * (d - radius), spread + variance)
    naive.measure(i, mount, radius, measured, variance)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_filter_agrees_with_whole_matrices(seed: int) -> None:
    rng = np.random.default_rng(seed)
    e, covariance, naive = new_filter(rng)
    for step in range(STEPS):
        if step % 8 == 0:
            add_both(rng, e, covariance, naive)
        reported, travel = rng.uniform(-0.2, 0.2, 2), float(rng.uniform(-1.0, 1.0))
        ring_turn, travel_turn = (0.0, 0.3) if step % 5 == 0 else (0.1, 0.1)
        variances = (0.0 if step % 5 == 0 else 1e-4, 2e-4, 1e-5)
        kernels.propagate(e, covariance, reported[0], reported[1], travel, ring_turn, travel_turn, variances)
        naive.propagate(reported, travel, ring_turn, travel_turn, variances)
        measure_both(rng, e, covariance, naive)
        assert_same(e, covariance, naive)


def test_a_removed_landmark_leaves_the_others_unchanged() -> None:
    rng = np.random.default_rng(5)
    e, covariance, naive = new_filter(rng)
    for _ in range(4):
        add_both(rng, e, covariance, naive)
        measure_both(rng, e, covariance, naive)
    kernels.remove_landmark(e, covariance, 1)
    order = [*range(FIRST), *(FIRST + 2 * i + k for i in (0, 3, 2) for k in (0, 1))]
    naive.landmarks = [naive.landmarks[i] for i in (0, 3, 2)]
    naive.covariance = naive.covariance[np.ix_(order, order)]
    assert_same(e, covariance, naive)
    kernels.remove_landmark(e, covariance, 2)
    naive.landmarks, naive.covariance = naive.landmarks[:2], naive.covariance[:-2, :-2]
    assert_same(e, covariance, naive)


def test_a_full_filter_takes_no_further_landmark() -> None:
    e, covariance, _ = new_filter(np.random.default_rng(0))
    taken = [kernels.add_landmark(e, covariance, 1.0, 0.0, 1.0, 0.0, 1.0) for _ in range(LANDMARKS_MAX + 1)]
    assert taken == [*range(LANDMARKS_MAX), -1]


def test_ranges_do_not_observe_the_heading_of_the_map() -> None:
    """However the estimate moves between readings, nothing is learnt of a turn or a shift of the whole map."""
    rng = np.random.default_rng(3)
    e, covariance, naive = new_filter(rng)
    covariance[:3, :] = covariance[:, :3] = 0.0
    covariance[0, 0] = covariance[1, 1] = covariance[2, 2] = 1.0
    naive.covariance = covariance[:FIRST, :FIRST].copy()
    for _ in range(3):
        add_both(rng, e, covariance, naive)
    for _ in range(30):
        kernels.propagate(e, covariance, 0.1, 0.0, 0.0, 0.05, 0.05, (1e-6, 0.0, 1e-6))
        naive.propagate(np.array([0.1, 0.0]), 0.0, 0.05, 0.05, (1e-6, 0.0, 1e-6))
        measure_both(rng, e, covariance, naive)
    assert covariance[0, 0] > 1.0
    assert covariance[1, 1] > 1.0
    assert covariance[RANGE, RANGE] < SIGMAS[RANGE] ** 2 * 2.0
