"""The likelihood's table against its formula, and against what a density must be."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.likelihood import BINS, LEVELS, build_levels, build_table, loglik
from tests import naive_bayes as naive_full

U0 = 1 / 4.5
EPS = 0.03


def table_of(half_box: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    table, inv_step, sigmas = np.empty((LEVELS, BINS)), np.empty(LEVELS), np.empty(LEVELS)
    build_table(half_box, 0.0003, 0.18, U0, EPS, table, inv_step, sigmas)
    return table, inv_step, sigmas


@pytest.mark.parametrize("half_box", [0.0, 0.005, 0.01524])
def test_each_entry_is_the_formula(half_box: float) -> None:
    table, inv_step, sigmas = table_of(half_box)
    assert sigmas[[0, -1]] == pytest.approx([0.0003, 0.18], rel=1e-12)
    for k in range(LEVELS):
        for b in range(BINS - 2):
            expected = naive_full.log_ratio(b / inv_step[k], half_box, sigmas[k], U0, EPS)
            assert table[k, b] == pytest.approx(expected, abs=2e-12)
        assert table[k, -1] == math.log(EPS)


@pytest.mark.parametrize("half_box", [0.0, 0.01524])
def test_between_entries_it_is_interpolated_and_even(half_box: float) -> None:
    table, inv_step, _ = table_of(half_box)
    rng = np.random.default_rng(1)
    for _ in range(3000):
        k = int(rng.integers(LEVELS))
        e = rng.normal() * BINS / inv_step[k] / 2
        expected = np.interp(abs(e) * inv_step[k], np.arange(BINS), table[k])
        assert loglik(table, inv_step, k, e) == pytest.approx(expected, abs=1e-12)
        assert loglik(table, inv_step, k, -e) == loglik(table, inv_step, k, e)
    assert loglik(table, inv_step, 0, 1e6) == math.log(EPS)


def test_the_density_adds_up_to_one() -> None:
    table, inv_step, sigmas = table_of(0.01524)
    for k in range(LEVELS):
        e = np.arange(BINS) / inv_step[k]
        density = (np.exp(table[k]) - EPS) * U0 / (1 - EPS)
        total = 2 * ((density[1:] + density[:-1]) / 2 * np.diff(e)).sum()
        assert total == pytest.approx(1.0, abs=0.01), sigmas[k]


def test_levels_are_the_nearest_on_a_logarithmic_scale() -> None:
    _, _, sigmas = table_of(0.01524)
    noises = np.array([(a, b) for a in (0.0001, 0.001, 0.0037, 0.024, 0.5) for b in (0.0, 0.005, 0.02)])
    levels = np.empty((len(noises), 64), np.int64)
    build_levels(noises, sigmas, levels, 6.5)
    for h, (absolute, relative) in enumerate(noises):
        for b in range(64):
            sigma = math.hypot(absolute, relative * (b + 0.5) / 6.5)
            assert levels[h, b] == naive_full.nearest_level(sigma, sigmas)
