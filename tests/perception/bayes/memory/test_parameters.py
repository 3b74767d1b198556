"""Tuning numbers that only work in a certain relation to one another."""

from __future__ import annotations

from perception.bayes.memory import parameters as p
from perception.bayes.memory.parameters import TRIPLE_MAX_M
from perception.shared_numbers import EVEN


def test_a_name_is_kept_at_a_lower_probability_than_it_is_given() -> None:
    assert p.DOUBT_PROBABILITY < EVEN < p.ESTABLISH_PROBABILITY


def test_a_longer_baseline_is_tried_than_the_longest_of_the_series() -> None:
    assert p.BASELINE_MIN_M * 2 ** (p.BASELINES - 1) < p.BASELINE_MAX_M
    assert p.NEIGHBOUR_BASELINE_MIN_M < TRIPLE_MAX_M


def test_a_grid_of_the_expected_width_is_not_laid_again() -> None:
    assert p.GRID_THINNEST < p.GRID_NARROW < 1.0 < p.GRID_WIDE


def test_the_noise_at_the_start_is_one_of_the_hypotheses() -> None:
    assert 0 <= p.START_NOISE < len(p.NOISE_ABSOLUTE_M) * len(p.NOISE_RELATIVE)
