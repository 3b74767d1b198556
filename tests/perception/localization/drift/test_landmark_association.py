"""Which landmark a range is from, against plain geometry and whole matrices."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.localization.drift import landmark_association as kernels
from perception.localization.drift.landmark_state import FIRST, SonarModel, X, Y
from perception.shared_numbers import NO_INDEX
from tests.perception.localization.drift.test_landmark_ranges import HALF_ANGLE, RADIUS_M, VARIANCES, new_filter

SONAR = SonarModel(*VARIANCES, HALF_ANGLE, 0.2, 7.0)
AHEAD = (0.0, 0.0, 1.0, 0.0)
"""A sensor at the origin that looks along x."""


def test_the_variance_of_a_bearing_is_that_of_the_whole_covariance() -> None:
    rng = np.random.default_rng(5)
    _, covariance = new_filter([(2.0, 0.3), (1.0, 1.5)])
    n = FIRST + 4
    root = 0.05 * rng.standard_normal((n, n))
    covariance[:n, :n] = root @ root.T
    dx, dy = 0.7, 1.4
    jacobian = np.zeros(n)
    jacobian[FIRST + 2 : FIRST + 4] = np.array([-dy, dx]) / (dx * dx + dy * dy)
    jacobian[X : Y + 1] = -jacobian[FIRST + 2 : FIRST + 4]
    naive = jacobian @ covariance[:n, :n] @ jacobian
    assert kernels.bearing_variance(covariance, 1, dx, dy) == pytest.approx(naive, rel=1e-9)


def test_the_nearest_in_deviations_explains_a_range_and_the_nearest_of_all_is_expected() -> None:
    e, covariance = new_filter([(2.0, 0.0), (1.2, 0.05), (0.0, 2.0)])
    best, nis, is_ambiguous, first, nearest, is_expected = kernels.associate(
        e, covariance, AHEAD, 2.0 - RADIUS_M, SONAR
    )
    assert (best, is_ambiguous, first, is_expected) == (0, False, 1, True)
    assert nis == pytest.approx(0.0, abs=1e-9)
    assert nearest == pytest.approx(math.hypot(1.2, 0.05) - RADIUS_M)


def test_a_range_between_two_landmarks_is_ambiguous_and_silence_is_of_none() -> None:
    e, covariance = new_filter([(2.0, 0.0), (2.02, 0.0)])
    assert kernels.associate(e, covariance, AHEAD, 2.01 - RADIUS_M, SONAR)[2]
    assert kernels.associate(e, covariance, AHEAD, math.inf, SONAR)[0] == NO_INDEX


def test_nothing_is_expected_outside_the_beam() -> None:
    e, covariance = new_filter([(0.0, 2.0), (-2.0, 0.0)])
    best, _, _, first, nearest, is_expected = kernels.associate(e, covariance, AHEAD, 2.0 - RADIUS_M, SONAR)
    assert (best, first, nearest, is_expected) == (NO_INDEX, NO_INDEX, math.inf, False)
