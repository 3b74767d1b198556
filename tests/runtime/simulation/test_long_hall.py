"""Tests of the long hall of forty drums."""

from __future__ import annotations

import pytest

from config.load import load_settings
from runtime.cycle.step import CycleRecord
from runtime.simulation.budget_sweep import long_hall_settings
from runtime.simulation.closed_loop import simulate
from runtime.simulation.long_hall import A_SIDE, long_hall


def test_forty_drums_that_do_not_overlap() -> None:
    for seed in range(20):
        drums = long_hall(seed).drum
        assert len(drums) == 2 * A_SIDE == 40
        for i, a in enumerate(drums):
            for b in drums[:i]:
                assert (a.x_m - b.x_m) ** 2 + (a.y_m - b.y_m) ** 2 > (a.radius_m + b.radius_m) ** 2
    assert long_hall(1) == long_hall(1) != long_hall(2)


@pytest.mark.compiled
@pytest.mark.parametrize("seconds", [8.0, pytest.param(600.0, marks=pytest.mark.soak)])
def test_tracks_suffice(seconds: float) -> None:
    settings = long_hall_settings(load_settings("irregular"))
    clusters: list[int] = []

    def on_cycle(record: CycleRecord, _truth: object) -> None:
        clusters.append(record.clusters)

    simulate(settings, long_hall(0), 0, seconds, on_cycle)
    assert max(clusters) < settings.perception.bayes.tracks_max, max(clusters)
