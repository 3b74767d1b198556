"""The window that follows the robot, and the rows of a beam, against plain geometry."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.messages import Firing, Pose
from perception.mapping.grid.window import (
    Ring,
    Window,
    columns_of_beam,
    octant,
    placed,
    row_of_beam,
    rows_within,
    set_edges,
)


@given(st.floats(-math.pi, math.pi))
def test_looking_directions_are_eighths_of_a_turn_around_the_axes(angle: float) -> None:
    eighths = angle / (math.pi / 4.0)
    if abs(abs(eighths - math.floor(eighths)) - 0.5) > 1e-9:
        assert octant(math.cos(angle), math.sin(angle)) == round(eighths) % 8


@given(st.floats(-10.0, 10.0), st.floats(0.05, 1.2), st.floats(-3.0, 3.0), st.floats(0.1, 4.0))
def test_row_of_a_beam_holds_its_points_and_no_others(bearing: float, half: float, dy: float, reach: float) -> None:
    edges = np.zeros(4)
    set_edges(bearing, half, edges)
    low, high = row_of_beam(dy, reach, edges)
    for dx in np.linspace(-4.5, 4.5, 91).tolist():
        off = math.remainder(math.atan2(dy, dx) - bearing, 2.0 * math.pi)
        margins = (half - abs(off), reach - math.hypot(dx, dy))
        if min(map(abs, margins)) > 1e-9 and math.hypot(dx, dy) > 1e-9:
            assert (min(margins) > 0.0) == (low <= dx <= high)


@given(st.floats(-10.0, 10.0), st.floats(0.05, 1.2), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(0.1, 9.0))
def test_cells_of_a_beam_are_those_whose_middles_lie_in_it(
    bearing: float, half: float, sx: float, sy: float, reach: float
) -> None:
    edges, cell_m, mask, corner = np.zeros(4), 0.5, 15, np.array([-9, -7])
    set_edges(bearing, half, edges)
    first_row, last_row = rows_within((corner, cell_m), sy, reach, mask)
    for iy in range(-7, -7 + mask + 1):
        dy = (iy + 0.5) * cell_m - sy
        first, last = columns_of_beam((corner, cell_m), sx, dy, reach, edges, mask)
        for ix in range(-9, -9 + mask + 1):
            dx = (ix + 0.5) * cell_m - sx
            off = math.remainder(math.atan2(dy, dx) - bearing, 2.0 * math.pi)
            margins = (half - abs(off), reach - math.hypot(dx, dy))
            if min(map(abs, margins)) > 1e-9 and math.hypot(dx, dy) > 1e-9:
                is_found = first_row <= iy <= last_row and first <= ix <= last
                assert (min(margins) > 0.0) == is_found


def test_window_keeps_what_stays_and_clears_what_comes_in() -> None:
    rng = np.random.default_rng(5)
    window, plane = Window(32, 0.1), np.zeros((32, 32))
    kept: dict[tuple[int, int], float] = {}
    x = y = 0.0
    for step in range(60):
        x, y = x + rng.normal(0.0, 0.3), y + rng.normal(0.0, 0.3) - 2.0 * (step % 20 == 19)
        assert window.follow(Pose(x, y, 0.0), (plane,))
        cx, cy = window.corner.tolist()
        assert max(abs(math.floor(at / 0.1) - 16 - c) for at, c in ((x, cx), (y, cy))) <= 4
        kept = {at: value for at, value in kept.items() if cx <= at[0] < cx + 32 and cy <= at[1] < cy + 32}
        expected = np.zeros((32, 32))
        for (ix, iy), value in kept.items():
            expected[iy - cy, ix - cx] = value
        np.testing.assert_array_equal(window.unrolled(plane), expected)
        for ix, iy in rng.integers(0, 32, (40, 2)).tolist():
            kept[cx + ix, cy + iy] = plane[(cy + iy) % 32, (cx + ix) % 32] = rng.random()


@pytest.mark.parametrize("pose", [Pose(math.nan, 0.0, 0.0), Pose(0.0, math.inf, 0.0), Pose(1e7, 0.0, 0.0)])
def test_impossible_pose_moves_nothing(pose: Pose) -> None:
    window, plane = Window(32, 0.1), np.ones((32, 32))
    assert window.follow(Pose(1.0, 2.0, 0.0), (plane,))
    before = window.corner.copy()
    assert not window.follow(pose, (plane,))
    np.testing.assert_array_equal(window.corner, before)
    assert plane.all()


def test_sensors_are_placed_on_the_turned_ring() -> None:
    firing = Firing(0.0, Pose(1.0, 2.0, -math.pi / 2.0), math.pi / 2.0, np.zeros(1))
    ring = Ring(np.array([[0.3, 0.1, 0.2], [0.3, 0.1, 0.2]]), 0.2, 0.0, 5.0, (1,))
    expected = [[0.9, 2.3, math.pi / 2.0 + 0.2], [1.1, 1.7, -math.pi / 2.0 + 0.2]]
    np.testing.assert_allclose(placed(firing, ring), expected)
