"""The bank of rates: each against a Kalman filter in numbers, what it finds, and what says nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.localization.drift.walk_rates import FORGETTING, WalkRates

RATES = np.array([0.01, 0.1, 1.0, 10.0])
PRIOR = np.array([1.0, 2.0, 2.0, 1.0])


def test_before_a_drive_the_rate_is_the_mean_of_the_prior() -> None:
    assert WalkRates(RATES, PRIOR).rate == pytest.approx(float(RATES @ PRIOR) / 6.0)


def test_the_probabilities_are_those_of_kalman_filters() -> None:
    bank, rng = WalkRates(RATES, PRIOR), np.random.default_rng(3)
    bank.restart(0.5)
    variances, means = [0.5] * 4, [0.0] * 4
    logs, prior = np.log(PRIOR / 6.0).tolist(), np.log(PRIOR / 6.0)
    main = 0.5
    for _ in range(20):
        way, noise, value = 0.3, float(rng.uniform(0.1, 0.5)), float(rng.standard_normal())
        predicted = main + bank.rate * way
        gain = predicted / (predicted + noise)
        after = (1.0 - gain) * predicted
        before, main = main, after
        for k in range(4):
            variances[k] += float(RATES[k]) * way
            total = variances[k] + noise
            logs[k] += FORGETTING * (float(prior[k]) - logs[k])
            logs[k] -= 0.5 * (math.log(total) + (value - means[k]) ** 2 / total)
            means[k] += variances[k] / total * (value - means[k])
            variances[k] *= noise / total
            means[k] -= gain * value
        top = max(logs)
        weights = [math.exp(one - top) for one in logs]
        logs = [one - top - math.log(sum(weights)) for one in logs]
        bank.enter(gain * value, before, after, way)
        expected = sum(w * float(q) for w, q in zip(weights, RATES, strict=True)) / sum(weights)
        assert bank.rate == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("rate", [0.01, 1.0])
def test_the_rate_of_a_walk_is_found(rate: float) -> None:
    bank, rng = WalkRates(RATES, PRIOR), np.random.default_rng(8)
    value = estimate = 0.0
    variance, noise = 0.1, 0.05
    bank.restart(variance)
    for _ in range(100):
        value += math.sqrt(rate * 0.25) * float(rng.standard_normal())
        predicted = variance + bank.rate * 0.25
        gain = predicted / (predicted + noise)
        correction = gain * (value + math.sqrt(noise) * float(rng.standard_normal()) - estimate)
        before, variance = variance, (1.0 - gain) * predicted
        estimate += correction
        bank.enter(correction, before, variance, 0.25)
    assert 0.4 * rate < bank.rate < 2.5 * rate
    other = WalkRates(RATES, PRIOR)
    other.assume(bank)
    assert other.rate == bank.rate


def test_a_way_that_shows_nothing_leaves_the_probabilities() -> None:
    bank = WalkRates(RATES, PRIOR)
    before = bank.rate
    for _ in range(5):
        bank.enter(0.0, 1.0, 1.0 + 0.3 * before, 0.3)
    assert bank.rate == before
