"""Tests of bench.consistency: the band against drawn errors, and the table's row of a drive."""

from __future__ import annotations

import numpy as np
import pytest

from bench import consistency
from config.load import load_settings
from config.settings import Settings
from config.world import OdometryConfig
from runtime.simulation.drift_trials import LEVELS, DriftOutcome


def test_the_band_holds_the_mean_of_consistent_errors_in_95_of_100_cases() -> None:
    low, high = consistency.band(3, 40)
    means = np.square(np.random.default_rng(1).standard_normal((4000, 40, 3))).sum(axis=2).mean(axis=1)
    assert np.mean((means > low) & (means < high)) == pytest.approx(0.95, abs=0.012)
    assert consistency.band(2, 100) == pytest.approx((1.63, 2.41), abs=0.01)


def test_each_level_with_drift_has_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    def drive(_settings: Settings, errors: OdometryConfig, seed: int, *, corrected: bool) -> DriftOutcome:
        assert corrected
        return DriftOutcome((0.01, 0.03), 0, 0, 0.1, 0.2, float(seed), 2.0, errors.scale - 1.0, 0.002)

    monkeypatch.setattr(consistency, "drive", drive)
    reported: list[str] = []
    rows = consistency.measure(load_settings(None), [2, 4], reported.append)
    assert len(rows) == len(LEVELS) - 1
    assert len(reported) == 2 * len(rows)
    row = rows["2%, 1°/√m"]
    assert (row["pose"], row["drums"], row["drives"]) == (3.0, 2.0, 2.0)
    assert (row["drum_m"], row["odometer_rms"]) == pytest.approx((0.02, 0.02))
    assert row["pose_low"] < 3.0 < row["pose_high"]
