"""The mixture of both models of reflection, against its formula for one reading."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.localization.expected_ranges import Expected
from perception.localization.mixed_reflection import Expectations, mixed_ratio
from perception.localization.range_likelihood import HEARD_SHARE, RangeModel, log_ratio

MODEL = RangeModel(0.03, 5.0)


def expected(*ranges: float) -> Expected:
    """These ranges at one pose."""
    row = np.array([ranges])
    return Expected(row, np.zeros_like(row), np.zeros_like(row))


def naive_likelihood(measured: float, range_m: float, variance: float) -> float:
    """Likelihood ratio of one reading by one model."""
    answers = range_m <= MODEL.window_m
    if math.isinf(measured):
        return (MODEL.dropout if answers else 1.0 - MODEL.outliers) / (1.0 - HEARD_SHARE)
    density = MODEL.outliers / MODEL.window_m
    if answers:
        sigma = math.sqrt(float(MODEL.sigma(np.array(range_m))) ** 2 + variance)
        echo = math.exp(-0.5 * ((measured - range_m) / sigma) ** 2) / (sigma * math.sqrt(2.0 * math.pi))
        density += (1.0 - MODEL.dropout - MODEL.outliers) * echo
    return density / (HEARD_SHARE / MODEL.window_m)


@pytest.mark.parametrize("measured", [1.0, 1.1, 3.0, math.inf])
@pytest.mark.parametrize("ranges", [(1.0, 1.0), (1.0, math.inf), (math.inf, 1.1), (math.inf, math.inf)])
def test_a_reading_is_from_either_model(measured: float, ranges: tuple[float, float]) -> None:
    cone, specular = ranges
    variance = (np.full((1, 1), 0.01), np.full((1, 1), 0.02))
    both = Expectations(expected(cone), expected(specular))
    found = mixed_ratio(MODEL, np.array([measured]), both, 0.3, variance)
    parts = 0.7 * naive_likelihood(measured, cone, 0.01), 0.3 * naive_likelihood(measured, specular, 0.02)
    assert found.log_ratio[0, 0] == pytest.approx(math.log(sum(parts)))
    assert found.prefers_specular[0, 0] == pytest.approx(parts[1] / sum(parts))
    assert 0.0 <= found.fits_cone[0, 0] + found.fits_specular[0, 0] <= 1.0


def test_a_share_of_one_is_one_model() -> None:
    measured = np.array([1.0, 2.0, math.inf])
    specular = expected(1.02, math.inf, 2.0)
    nothing = (np.zeros((1, 1)), np.zeros((1, 1)))
    found = mixed_ratio(MODEL, measured, Expectations(expected(4.0, 4.0, 4.0), specular), 1.0, nothing)
    alone, fits = log_ratio(MODEL, measured, specular.range_m)
    assert found.log_ratio == pytest.approx(alone)
    assert found.fits_specular == pytest.approx(fits)
    assert not found.fits_cone.any()
