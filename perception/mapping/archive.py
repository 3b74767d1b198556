"""Records of what the robot has left behind, found again by their place.

The part of a map that is near the robot is worked on in arrays of a fixed size. What lies behind waits here: as many
records as there is memory for, under a grid of their places, so that the cost of finding those near the robot does
not depend on how many there are.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from perception.bounds import COUNT, Fields, bounds
from perception.records import Structured

ARCHIVE_CELL_M: Final = 4.0
"""Edge of a grid cell: a ring looks as far as two."""
START: Final = 16
"""Room at the start; it doubles when it is full."""


class Archive:
    """Records with a number and a place, under a grid.

    Parameters
    ----------
    dtype : dtype
        Of a record; its fields `number` (int), `x` and `y` (m) are used here.
    row_bounds : mapping
        Bounds of its fields.
    """

    SCRATCH: Final = ("_cells", "_index")
    """Derived from the records; not in a snapshot."""
    BOUNDS: Final = bounds(archived_rows=lambda self: self._row_bounds, count=COUNT)

    def __init__(self, dtype: np.dtype[Any], row_bounds: Fields) -> None:
        self._row_bounds = row_bounds
        self.archived_rows: Structured = np.zeros(START, dtype)
        """(≥ count,): the records; those from `count` on are free."""
        self.count = 0
        """How many there are."""
        self._cells: dict[tuple[int, int], list[int]] = {}
        self._index: dict[int, int] = {}

    def contradiction(self) -> str | None:
        """Return which records have no number of their own, None if each has one."""
        if len(np.unique(self.archived_rows["number"][: self.count])) < self.count:
            return f"count is {self.count}, but not as many objects have a number of their own"
        return None

    def add(self, row: Structured) -> None:
        """Add a record, shape (1,), whose number is not in the archive."""
        if self.count == len(self.archived_rows):
            self.archived_rows = np.concatenate([self.archived_rows, np.zeros_like(self.archived_rows)])
        self.archived_rows[self.count : self.count + 1] = row
        self._enter(self.count)
        self.count += 1

    def take(self, number: int) -> Structured:
        """Remove a record and return it, shape (1,).

        Raises
        ------
        KeyError
            There is none of this number.
        """
        at, last = self._index[number], self.count - 1
        row: Structured = self.archived_rows[at : at + 1].copy()
        self._leave(at)
        if at != last:
            self._leave(last)
            self.archived_rows[at] = self.archived_rows[last]
            self._enter(at)
        self.archived_rows.view(np.uint8).reshape(len(self.archived_rows), -1)[last] = (
            0  # a snapshot holds nothing that is gone
        )
        self.count = last
        return row

    def near(self, x: float, y: float, radius: float) -> list[int]:
        """Return the numbers of the records within `radius` of (x, y), m, the nearest first.

        Parameters
        ----------
        x, y, radius : float
            m.
        """
        found: list[int] = []
        low, high = self._cell(x - radius, y - radius), self._cell(x + radius, y + radius)
        for cell_x in range(low[0], high[0] + 1):
            for cell_y in range(low[1], high[1] + 1):
                found += self._cells.get((cell_x, cell_y), ())
        if not found:
            return []
        rows = self.archived_rows
        numbers, distances = rows["number"][found], np.hypot(rows["x"][found] - x, rows["y"][found] - y)
        order = np.lexsort((numbers, distances))
        nearest: list[int] = numbers[order[distances[order] <= radius]].tolist()
        return nearest

    def held(self) -> Structured:
        """Return the records as a view, shape (count,)."""
        return self.archived_rows[: self.count]

    def distance(self, number: int, x: float, y: float) -> float:
        """Return the distance of a record from (x, y), m."""
        row = self.archived_rows[self._index[number]]
        return math.hypot(float(row["x"]) - x, float(row["y"]) - y)

    def find(self, number: int) -> Structured | None:
        """Return the record of a number as a view, shape (1,), None if there is none."""
        at = self._index.get(number)
        return None if at is None else self.archived_rows[at : at + 1]

    def clear(self) -> None:
        """Remove all records."""
        self.archived_rows = np.zeros(START, self.archived_rows.dtype)
        self.count = 0
        self._cells, self._index = {}, {}

    def drop_caches(self) -> None:
        """Build the grid anew, after the records were replaced."""
        self._cells, self._index = {}, {}
        for at in range(self.count):
            self._enter(at)

    def _enter(self, at: int) -> None:
        row = self.archived_rows[at]
        self._cells.setdefault(self._cell(float(row["x"]), float(row["y"])), []).append(at)
        self._index[int(row["number"])] = at

    def _leave(self, at: int) -> None:
        row = self.archived_rows[at]
        cell = self._cell(float(row["x"]), float(row["y"]))
        self._cells[cell].remove(at)
        if not self._cells[cell]:
            del self._cells[cell]
        del self._index[int(row["number"])]

    @staticmethod
    def _cell(x: float, y: float) -> tuple[int, int]:
        return math.floor(x / ARCHIVE_CELL_M), math.floor(y / ARCHIVE_CELL_M)
