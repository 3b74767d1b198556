"""How much ranges change for each unit of the way, apart from noise on ranges that stay."""

from __future__ import annotations

import numpy as np
import pytest

from runtime.recording.conventions.way_ratios import without_noise


def test_noise_on_ranges_that_stay_is_no_ratio() -> None:
    rng = np.random.default_rng(1)
    assert len(without_noise(0.4 * rng.standard_normal(2000))) == 0
    assert len(without_noise(np.empty(0))) == 0


def test_what_follows_the_way_is_left_among_noise() -> None:
    rng = np.random.default_rng(2)
    left = without_noise(np.concatenate([rng.normal(1.0, 0.05, 500), 0.3 * rng.standard_normal(2000)]))
    assert float(np.median(left)) == pytest.approx(1.0, abs=0.1)
    assert 400 < len(left) < 700
