"""Joint compatibility of echoes and landmarks: the displacement against the truth, and layouts that fit twice."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.messages import Pose, wrap_angle
from perception.localization.drift.joint_compatibility import (
    PLACE_SIGMA_M,
    SLIP_TURN_SIGMA,
    Disc,
    Echo,
    _corrected,
    find_displacement,
    share_improved,
)

HALF_ANGLE = math.radians(12.0)
RING = [Pose(0.38 * math.cos(a), 0.38 * math.sin(a), a) for a in np.arange(24) * math.radians(15.0)]
PLACES = [(2.1, 0.4), (0.9, 1.9), (-1.4, 1.6), (-2.2, -0.5), (-0.7, -1.7), (1.5, -1.9), (3.2, 2.0)]
RADIUS_M = 0.3


def heard(at: Pose, places: list[tuple[float, float]], noise: np.random.Generator | None = None) -> list[Echo]:
    """Return the echoes of a ring at a true pose, as seen from the believed one at the origin."""
    echoes = []
    for mount in RING:
        sensor, found = at.compose(mount), math.inf
        for x, y in places:
            d, bearing = math.hypot(x - sensor.x, y - sensor.y), math.atan2(y - sensor.y, x - sensor.x)
            if abs(wrap_angle(bearing - sensor.theta)) < HALF_ANGLE:
                found = min(found, d - RADIUS_M)
        if math.isfinite(found):
            off = 1.0 if noise is None else 1.0 + 0.01 * noise.standard_normal()
            echoes.append(Echo(mount.x, mount.y, mount.theta, found * off))
    return echoes


def discs(places: list[tuple[float, float]]) -> list[Disc]:
    """Return landmarks at these places."""
    return [Disc(x, y, RADIUS_M) for x, y in places]


def test_the_displacement_of_the_ring_is_found_in_spite_of_noise_and_strays() -> None:
    answers = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        x, y, turn = (rng.standard_normal(3) * (0.3, 0.3, math.radians(9.0))).tolist()
        true = Pose(x, y, turn)
        echoes = heard(true, PLACES, rng)
        echoes[seed % 6] = echoes[seed % 6]._replace(range_m=rng.uniform(0.5, 3.0))
        found = find_displacement(echoes, discs(PLACES), HALF_ANGLE)
        if found is None:
            continue
        answers += 1
        off = np.array([found.pose.x - true.x, found.pose.y - true.y, wrap_angle(found.pose.theta - true.theta)])
        assert math.hypot(off[0], off[1]) < 0.1
        assert abs(off[2]) < math.radians(5.0)
        assert off @ np.linalg.solve(found.covariance_matrix(), off) < 16.3, "χ² of three, one in a thousand"
    assert answers >= 9


def test_two_displacements_that_fit_alike_are_no_answer() -> None:
    row = [(x, y) for x in (-2.4, -1.6, -0.8, 0.0, 0.8, 1.6, 2.4) for y in (1.4, -1.4)]
    assert find_displacement(heard(Pose(0.4, 0.0, 0.0), row), discs(row), HALF_ANGLE) is None


def test_too_few_echoes_are_no_answer() -> None:
    assert find_displacement(heard(Pose(0.1, 0.0, 0.0), PLACES)[:3], discs(PLACES), HALF_ANGLE) is None
    assert find_displacement([], discs(PLACES), HALF_ANGLE) is None


def test_echoes_of_something_else_are_no_answer() -> None:
    rng = np.random.default_rng(0)
    strays = [Echo(mount.x, mount.y, mount.theta, rng.uniform(0.3, 4.0)) for mount in RING[::2]]
    assert find_displacement(strays, discs(PLACES[:3]), HALF_ANGLE) is None


def test_after_a_slip_most_landmarks_fit_better_and_after_two_of_them_moved_most_do_not() -> None:
    slipped = heard(Pose(0.3, 0.2, 0.1), PLACES)
    found = find_displacement(slipped, discs(PLACES), HALF_ANGLE)
    assert found is not None
    assert share_improved(found, slipped, discs(PLACES), HALF_ANGLE) > 0.6
    echoes = heard(Pose(0.0, 0.0, 0.0), [(2.3, 0.5), (0.7, 1.7), *PLACES[2:]])
    found = find_displacement(echoes, discs(PLACES), HALF_ANGLE)
    assert found is None or share_improved(found, echoes, discs(PLACES), HALF_ANGLE) < 0.4


def test_a_scalar_correction_is_that_of_the_whole_matrices() -> None:
    root = np.random.default_rng(3).standard_normal((3, 3))
    covariance, row, noise, innovation = root @ root.T, np.array([0.3, -0.8, 0.5]), 0.2, 0.7
    upper = tuple(covariance[np.triu_indices(3)].tolist())
    squared, pose, after = _corrected(Pose(1.0, 2.0, 0.1), upper, tuple(row.tolist()), innovation, noise)
    variance = row @ covariance @ row + noise
    gain = covariance @ row / variance
    assert squared == pytest.approx(innovation**2 / variance)
    assert (pose.x, pose.y, pose.theta) == pytest.approx(tuple(np.array([1.0, 2.0, 0.1]) + gain * innovation))
    assert after == pytest.approx((covariance - np.outer(gain, gain) * variance)[np.triu_indices(3)])
    assert PLACE_SIGMA_M > 0.0 < SLIP_TURN_SIGMA
