"""The likelihood's table against its formula: entries, interpolation, total probability and noise levels."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.inference.likelihood import (
    build_levels,
    build_table,
    level_of,
    log_likelihood,
)
from perception.bayes.memory.settings_record import (
    NOISES,
    RANGE_BINS,
    RANGE_BINS_PER_M,
    TABLE_BINS,
    TABLE_LEVELS,
    NoiseModel,
    Settings,
)
from perception.records import records, zeros
from tests import naive_bayes

U0 = 1 / 4.5
EPS = 0.03
RELATIVE = (0.0, 0.005, 0.01, 0.02)


def table_of(half_box: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    table, inv_step, sigmas = np.empty((TABLE_LEVELS, TABLE_BINS)), np.empty(TABLE_LEVELS), np.empty(TABLE_LEVELS)
    build_table(half_box, 0.0003, 0.18, U0, EPS, table, inv_step, sigmas)
    return table, inv_step, sigmas


@pytest.mark.parametrize("half_box", [0.0, 0.005, 0.01524])
def test_each_entry_is_the_formula(half_box: float) -> None:
    table, inv_step, sigmas = table_of(half_box)
    assert sigmas[[0, -1]] == pytest.approx([0.0003, 0.18], rel=1e-12)
    for k in range(TABLE_LEVELS):
        for b in range(TABLE_BINS - 2):
            expected = naive_bayes.log_ratio(b / inv_step[k], half_box, sigmas[k], U0, EPS)
            assert table[k, b] == pytest.approx(expected, abs=2e-12)
        assert table[k, -1] == math.log(EPS)


@pytest.mark.parametrize("half_box", [0.0, 0.01524])
def test_between_entries_it_is_interpolated_and_even(half_box: float) -> None:
    table, inv_step, _ = table_of(half_box)
    settings = zeros(Settings, 1)
    settings["table"], settings["table_bins_per_m"] = table, inv_step
    p, rng = records(Settings, settings), np.random.default_rng(1)
    for _ in range(800):
        k = int(rng.integers(TABLE_LEVELS))
        e = rng.normal() * TABLE_BINS / inv_step[k] / 2
        expected = np.interp(abs(e) * inv_step[k], np.arange(TABLE_BINS), table[k])
        assert log_likelihood(p, k, e) == pytest.approx(expected, abs=1e-12)
        assert log_likelihood(p, k, -e) == log_likelihood(p, k, e)
    assert log_likelihood(p, 0, 1e6) == math.log(EPS)


def test_the_density_adds_up_to_one() -> None:
    table, inv_step, sigmas = table_of(0.01524)
    for k in range(TABLE_LEVELS):
        e = np.arange(TABLE_BINS) / inv_step[k]
        density = (np.exp(table[k]) - EPS) * U0 / (1 - EPS)
        total = 2 * ((density[1:] + density[:-1]) / 2 * np.diff(e)).sum()
        assert total == pytest.approx(1.0, abs=0.01), sigmas[k]


def test_levels_are_the_nearest_on_a_logarithmic_scale() -> None:
    _, _, sigmas = table_of(0.01524)
    settings, wanted = (
        zeros(Settings, 1),
        np.array([(a, b) for a in (0.0001, 0.001, 0.0037, 0.024, 0.5) for b in RELATIVE]),
    )
    noises = settings["noises"][0]
    noises["absolute_m"], noises["relative"] = wanted.T
    build_levels(records(NoiseModel, noises), sigmas)
    p = records(Settings, settings)
    for h, (absolute, relative) in enumerate(wanted):
        for b in range(RANGE_BINS):
            r = (b + 0.5) / RANGE_BINS_PER_M
            level = naive_bayes.nearest_level(math.hypot(absolute, relative * r), sigmas)
            assert level_of(p, h, r) == level
        assert level_of(p, h, 1e6) == level
    assert len(wanted) == NOISES
