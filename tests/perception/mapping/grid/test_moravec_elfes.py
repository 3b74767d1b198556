"""The grid of 1985: profiles, one unit of mass, and what silence does to it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.messages import Firing, Pose
from perception.mapping.grid.moravec_elfes import EMPTY, OCCUPIED, MoravecElfesGrid
from perception.mapping.grid.window import Ring, Window

RING = Ring(np.array([[0.0, 0.0, 0.0]]), math.radians(15.0), 0.0, 5.0)
UNKNOWN = np.full(1, math.nan)


def grid_after(*ranges: float, silence_m: float = 0.0) -> MoravecElfesGrid:
    grid = MoravecElfesGrid(Window(128, 0.1), RING)
    for r in ranges:
        grid.observe(Firing(0.0, Pose(0.05, 0.05, 0.0), 0.0, np.array([r])), UNKNOWN, 1, silence_m)
    return grid


@pytest.mark.parametrize("r", [1.0, 2.33, 4.9])
def test_an_echo_is_one_unit_of_mass_however_wide_its_arc(r: float) -> None:
    cells = grid_after(r).cells
    assert cells[..., OCCUPIED].sum() == pytest.approx(1.0)
    assert np.count_nonzero(cells[..., OCCUPIED]) > 2


def test_the_inside_of_the_beam_is_empty_by_its_profile() -> None:
    cells = grid_after(2.0).cells
    d, inner = 1.0, 2.0 - 0.065
    along = 1.0 - ((d - 0.15) / (inner - 0.15)) ** 2
    assert cells[0, 10, EMPTY] == pytest.approx(along)
    theta = math.atan2(0.2, 1.0)
    along = 1.0 - ((math.hypot(1.0, 0.2) - 0.15) / (inner - 0.15)) ** 2
    assert cells[2, 10, EMPTY] == pytest.approx(along * (1.0 - (theta / RING.half_angle) ** 2))
    assert not cells[:, 30:100].any()


def test_the_greater_value_decides_and_silence_erases_a_wall() -> None:
    heard = grid_after(*[2.0] * 8)
    at = (0 - int(heard.window.corner[1]), 20 - int(heard.window.corner[0]))
    assert heard.probability(None)[at] > 0.7
    erased = grid_after(*[2.0] * 8, *[math.inf] * 8, silence_m=4.0)
    assert erased.probability(None)[at] < 0.3
    np.testing.assert_array_equal(grid_after(2.0, math.inf).cells, grid_after(2.0).cells)
    erased.clear()
    assert not erased.cells.any()


def test_impossible_pose_and_sensor_that_did_not_fire_enter_nothing() -> None:
    grid = grid_after(math.nan, silence_m=4.0)
    grid.observe(Firing(0.0, Pose(math.nan, 0.0, 0.0), 0.0, np.array([1.0])), UNKNOWN, 1, 4.0)
    assert not grid.cells.any()
