"""Random halls with mirrors for walls and decoys among the drums, on seeds that were not used for tuning.

Six here, sixteen in `make soak`; `echolocate experiment hallway --scene halls --seeds 100` measures a hundred.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_settings
from runtime.simulation.open_loop import HallOutcome, run_scene
from runtime.simulation.random_halls import random_hall

pytestmark = pytest.mark.compiled

FT = 0.3048
HALLS = (6, pytest.param(16, marks=pytest.mark.soak))
SETTINGS = load_settings("hallway", ["perception.method=bayes"])


@pytest.fixture(scope="module", params=HALLS)
def outcomes(request: pytest.FixtureRequest) -> list[HallOutcome]:
    return [outcome for seed in range(request.param) for outcome in run_scene(SETTINGS, "halls", 5000 + seed)]


def test_drums_are_found_and_nothing_else(outcomes: list[HallOutcome]) -> None:
    rows = [row for outcome in outcomes for row in outcome.drums]
    errors = [e / FT for row in rows if (e := row["error"]) is not None]
    assert len(rows) == 8 * len(outcomes)
    assert len(errors) >= 0.98 * len(rows)
    assert sum(outcome.false for outcome in outcomes) <= 1
    assert np.mean(errors) <= 0.02


def test_the_covariance_is_honest(outcomes: list[HallOutcome]) -> None:
    """The 95 % ellipses hold 92 to 98 %, and three binomial standard deviations more or less: the drums are few."""
    inside = [actual for outcome in outcomes for actual in outcome.inside]
    slack = 3.0 * math.sqrt(0.95 * 0.05 / len(inside))
    assert len(inside) > 6 * len(outcomes)
    assert 0.92 - slack <= np.mean(inside) <= 0.98 + slack


def test_a_seed_determines_the_hall() -> None:
    assert random_hall(1) == random_hall(1)
    assert random_hall(1) != random_hall(2)
    for seed in range(20):
        world, path = random_hall(seed)
        radii = sorted(round(d.radius_m / FT, 2) for d in world.drum)
        assert radii == [0.35, *[1.0] * 8, 2.2]
        assert len(world.box) == len(world.polygon) == 1
        # The ring, 1.25 ft in radius, goes through without touching anything.
        clear = min(math.dist(p[:2], (d.x_m, d.y_m)) - d.radius_m for p in path for d in world.drum)
        assert clear > 1.25 * FT
