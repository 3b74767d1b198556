"""The likelihood of ranges: a probability, and its distribution at a true pose."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.localization.room.range_likelihood import HEARD_PRIOR, RangeModel, log_ratio, log_ratio_of_true_pose
from tests.perception.localization.rooms import RING

MODEL = RangeModel.of_ring(RING)


@pytest.mark.parametrize("expected", [0.5, 3.0, 6.0, 20.0, math.inf])
def test_all_readings_together_have_probability_one(expected: float) -> None:
    step = 1e-3
    measured = np.arange(0.5 * step, MODEL.window_m, step)
    density = np.exp(log_ratio(MODEL, measured, np.array(expected))[0]) * HEARD_PRIOR / MODEL.window_m
    silence = np.exp(log_ratio(MODEL, np.array(math.inf), np.array(expected))[0]) * (1.0 - HEARD_PRIOR)
    assert density.sum() * step + silence == pytest.approx(1.0, abs=1e-3)


def test_the_probability_to_fit_falls_with_the_error() -> None:
    _, fits = log_ratio(MODEL, np.array([2.0, 2.05, 2.2, math.inf]), np.array(2.0))
    assert fits[0] > 0.99
    assert list(fits) == sorted(fits, reverse=True)
    assert fits[3] == 0.0
    assert log_ratio(MODEL, np.array(2.0), np.array(math.inf))[1] == 0.0


def test_the_errors_of_a_range_add() -> None:
    model = RangeModel(resolution_m=0.3, window_m=5.0, noise_relative=0.01, noise_m=0.02)
    assert model.sigma(np.array([2.0])) == pytest.approx([math.sqrt(0.3**2 / 12 + 0.02**2 + 0.02**2)])
    assert model.sigma(np.array([math.inf])) == model.sigma(np.array([5.0]))


def test_mean_and_deviation_at_a_true_pose_are_those_of_drawn_readings() -> None:
    """Each echo is at its typical error, missing or wild."""
    rng = np.random.default_rng(1)
    expected = np.where(np.arange(24) % 2, rng.uniform(0.5, 5.0, 24), math.inf)
    sums, predicted = [], []
    for _ in range(400):
        measured = expected + MODEL.sigma(expected) * rng.standard_normal(24)
        wild, lost = rng.random((2, 24))
        measured[lost < MODEL.dropout] = math.inf
        measured[wild < MODEL.outliers] = rng.uniform(0.0, MODEL.window_m, int((wild < MODEL.outliers).sum()))
        sums.append(log_ratio(MODEL, measured, expected)[0].sum())
        predicted.append(log_ratio_of_true_pose(MODEL, measured))
    mean, sigma = np.mean(predicted, axis=0)
    assert np.mean(sums) == pytest.approx(mean, abs=0.7 * sigma)
    assert np.std(sums) == pytest.approx(sigma, rel=0.5)
