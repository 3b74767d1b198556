"""Tests of the timing statistics: exact quantiles, maxima over the whole run, bounded memory."""

from __future__ import annotations

import numpy as np
import pytest

from runtime.timing.cycle_stats import KEPT_MAX, CycleStats


def test_empty_stats_are_zero() -> None:
    stats = CycleStats(0.005)
    assert stats.cycle_us() == stats.lag_us() == {"p50": 0.0, "p99": 0.0, "max": 0.0}
    assert (stats.cycles, stats.late) == (0, 0)


def test_quantiles_are_numpys_in_microseconds() -> None:
    rng = np.random.default_rng(3)
    took, lag = rng.exponential(1e-3, 1000), rng.exponential(2e-3, 1000)
    stats = CycleStats(0.005)
    for pair in zip(took.tolist(), lag.tolist(), strict=True):
        stats.add_cycle(*pair)
    spread = stats.lag.spread()
    assert spread["p999"] == pytest.approx(1e6 * np.quantile(lag, 0.999), abs=0.051)
    for got, values in ((stats.cycle_us(), took), (stats.lag_us(), lag)):
        p50, p99 = 1e6 * np.quantile(values, [0.5, 0.99])
        assert (got["p50"], got["p99"], got["max"]) == pytest.approx((p50, p99, 1e6 * values.max()), abs=0.051)
    assert stats.late == int((lag > 0.005).sum())


def test_late_is_beyond_the_limit_only() -> None:
    stats = CycleStats(0.005)
    for lag_s in (0.0, 0.005, 0.0051, 1.0):
        stats.add_cycle(0.001, lag_s)
    assert (stats.cycles, stats.late) == (4, 2)


def test_the_maximum_outlives_the_window() -> None:
    stats = CycleStats(0.005)
    stats.add_cycle(1.0, 2.0)
    for _ in range(KEPT_MAX):
        stats.add_cycle(0.001, 0.0)
    assert stats.cycles == KEPT_MAX + 1
    assert stats.cycle_us() == {"p50": 1000.0, "p99": 1000.0, "max": 1_000_000.0}
    assert stats.lag_us() == {"p50": 0.0, "p99": 0.0, "max": 2_000_000.0}
