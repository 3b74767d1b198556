"""The known part of an evidence grid: cropped, in per cent, and merged where it is too large to show."""

from __future__ import annotations

import numpy as np
import pytest

from perception.mapping.grid.known_cells import UNKNOWN, known_cells
from perception.percept import OccupancyWindow


def window(*cells: tuple[int, int, float], side: int = 8) -> OccupancyWindow:
    """Return a window with these rows, columns and probabilities; its corner is at (−1, 2) m."""
    occupied = np.full((side, side), 0.5, np.float32)
    for row, column, probability in cells:
        occupied[row, column] = probability
    return OccupancyWindow(occupied, -1.0, 2.0, 0.5)


def test_the_rectangle_of_what_is_known() -> None:
    known = known_cells(window((2, 3, 0.9), (4, 6, 0.126)))
    assert known.percent.tolist() == [[90, -1, -1, -1], [-1] * 4, [-1, -1, -1, 13]]
    assert (known.x_m, known.y_m, known.cell_m) == (0.5, 3.0, 0.5)


def test_a_window_that_knows_nothing_has_no_cells() -> None:
    assert known_cells(window()).percent.shape == (0, 0)


@pytest.mark.parametrize("side_max", [1, 2, 3, 7])
def test_merged_cells_keep_the_greatest_and_lie_where_they_were(side_max: int) -> None:
    rng = np.random.default_rng(3)
    cells = [
        (int(r), int(c), float(p)) for r, c, p in zip(*rng.integers(0, 23, (2, 60)), rng.random(60), strict=True)
    ]
    fine, coarse = known_cells(window(*cells, side=23)), known_cells(window(*cells, side=23), side_max)
    assert max(coarse.percent.shape) <= side_max
    factor = round(coarse.cell_m / fine.cell_m)
    assert (coarse.x_m, coarse.y_m) == (fine.x_m, fine.y_m)
    for row, column in np.ndindex(coarse.percent.shape):
        square = fine.percent[row * factor : (row + 1) * factor, column * factor : (column + 1) * factor]
        assert coarse.percent[row, column] == square.max(initial=UNKNOWN)
