"""The grid of 1989: below one half before the range, a peak at it, one half behind."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.messages import Firing, Pose
from perception.mapping.grid.elfes import EMPTY_PEAK, LOG_ODDS_MAX, ElfesGrid
from perception.mapping.grid.window import Ring, Window

RING = Ring(np.array([[0.0, 0.0, 0.0]]), math.radians(15.0), 0.0, 5.0)
UNKNOWN = np.full(1, math.nan)


def grid_after(*ranges: float, silence_m: float = 0.0) -> ElfesGrid:
    grid = ElfesGrid(Window(128, 0.1), RING)
    for r in ranges:
        grid.observe(Firing(0.0, Pose(0.05, 0.05, 0.0), 0.0, np.array([r])), UNKNOWN, 1, silence_m)
    return grid


def test_profile_of_one_echo() -> None:
    grid = grid_after(2.0)
    row = grid.probability(None)[-int(grid.window.corner[1]), -int(grid.window.corner[0]) :]
    assert row[10] == pytest.approx(0.5 - EMPTY_PEAK, abs=1e-6)
    assert row[20] == row.max() > 0.6
    assert (row[22:50] == 0.5).all()


def test_echoes_are_shared_over_the_arc() -> None:
    near, far = (grid.log_odds.max() for grid in (grid_after(0.6), grid_after(4.0)))
    assert near > 2.0 * far > 0.0


def test_evidence_adds_up_to_a_limit_and_silence_is_passage() -> None:
    grid = grid_after(*[0.4] * 60)
    assert grid.log_odds.max() == LOG_ODDS_MAX
    silent = grid_after(math.inf, silence_m=1.0)
    assert silent.log_odds[0, 5] == pytest.approx(math.log((0.5 - EMPTY_PEAK) / (0.5 + EMPTY_PEAK)))
    assert not silent.log_odds[:, 11:100].any()
    assert not grid_after(math.inf, math.nan).log_odds.any()
    grid.clear()
    assert not grid.log_odds.any()
    grid.observe(Firing(0.0, Pose(math.nan, 0.0, 0.0), 0.0, np.array([1.0])), UNKNOWN, 1, 4.0)
    assert not grid.log_odds.any()
