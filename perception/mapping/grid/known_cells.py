"""The part of an evidence grid's window in which anything is known, as pages, bags and figures show it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.percept import OccupancyWindow
from perception.shared_numbers import EVEN

UNKNOWN: Final = -1
"""In place of a probability in per cent, as in ROS's `nav_msgs/OccupancyGrid`."""


@dataclass(frozen=True, slots=True, eq=False)
class KnownCells:
    """The smallest rectangle of cells that holds all that is known."""

    percent: NDArray[np.int8]
    """(rows, columns): probability that something in the cell answers, 0 to 100, or `UNKNOWN`; row by row from the
    smallest y. Where nothing is known it has no rows and columns."""
    x_m: float
    y_m: float
    """The outer corner of the first cell, in the odometry's frame, m."""
    cell_m: float
    """Side of a cell, m."""


def known_cells(window: OccupancyWindow, side_max: int | None = None) -> KnownCells:
    """Return what a window knows.

    Parameters
    ----------
    window : OccupancyWindow
        As of `EvidenceGrid.occupancy`.
    side_max : int, optional
        Greatest number of rows and of columns; where there are more, one cell stands for a square of them, with the
        greatest of their probabilities.
    """
    known = window.occupied != EVEN
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not len(rows):
        return KnownCells(np.zeros((0, 0), np.int8), window.x_m, window.y_m, window.cell_m)
    top, left = int(rows[0]), int(columns[0])
    part = np.s_[top : int(rows[-1]) + 1, left : int(columns[-1]) + 1]
    percent = np.where(known[part], np.rint(100.0 * window.occupied[part]), UNKNOWN).astype(np.int8)
    merged = 1 if side_max is None else math.ceil(max(percent.shape) / side_max)
    if merged > 1:
        percent = _merged(percent, merged)
    x_m, y_m = window.x_m + left * window.cell_m, window.y_m + top * window.cell_m
    return KnownCells(np.ascontiguousarray(percent), x_m, y_m, merged * window.cell_m)


def _merged(percent: NDArray[np.int8], count: int) -> NDArray[np.int8]:
    """Return the greatest of each square of `count` by `count` cells; the last ones may be smaller."""
    at_rows, at_columns = (np.arange(0, side, count) for side in percent.shape)
    merged: NDArray[np.int8] = np.maximum.reduceat(np.maximum.reduceat(percent, at_rows, 0), at_columns, 1)
    return merged
