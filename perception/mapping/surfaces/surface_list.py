"""The surfaces found so far, those of the present local map and those behind, as rows that a snapshot holds."""

from __future__ import annotations

import math
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray

from perception.bounds import COUNT, SIGNED, Count, Finite, Flag, Place, bounds
from perception.kernel import Floats, Ints, kernel
from perception.map_moves import MapMoves
from perception.mapping.surfaces.parameters import AGREES_M
from perception.records import Record, Structured, zeros


class Surface(Record):
    """A straight piece of surface, or a part of a polyline, in the method's frame."""

    number: Annotated[int, SIGNED]
    """The polyline's, in order of its parts; less than 0 of a straight piece, which may be a wall."""
    submap: Count
    """Number of the map of the way from which it was heard."""
    is_live: Flag
    """Whether it is of the present local map."""
    x1: Place
    y1: Place
    x2: Place
    y2: Place
    variance_across: Finite
    """Of its middle, across, m²."""
    variance_turn: Finite
    """Of its direction, rad²."""
    echoes: Finite
    evidence: Finite
    """Log odds that something is there, nat."""


ENDS: Final = ("x1", "y1", "x2", "y2")
GROUP: Final = 16
"""Points that follow each other lie near each other: so many are compared with a segment at once."""
COMPARED: Final = 5
"""Places along a surface that are compared with others."""


def ends_of(rows: Structured) -> Floats:
    """Return the ends x, y, x, y of surfaces, shape (n, 4), m."""
    return np.column_stack([rows[name] for name in ENDS]).reshape(-1, 4)


@kernel
def find_near(points: Floats, ends: Floats, reaches: Floats, found: Ints) -> None:
    """Write 1 for each point that lies near one of some segments, and leave the others as they are.

    Parameters
    ----------
    points : (n, 2) float
        m.
    ends : (k, 4) float
        Ends x, y, x, y of the segments, m.
    reaches : (k,) float
        How near each of them, m.
    found : (n,) int
        Updated.
    """
    for begin in range(0, len(points), GROUP):
        end = min(begin + GROUP, len(points))
        low_x, high_x, low_y, high_y = math.inf, -math.inf, math.inf, -math.inf
        for n in range(begin, end):
            low_x, high_x = min(low_x, points[n, 0]), max(high_x, points[n, 0])
            low_y, high_y = min(low_y, points[n, 1]), max(high_y, points[n, 1])
        for k in range(len(ends)):
            ax, ay = ends[k, 0], ends[k, 1]
            bx, by = ends[k, 2] - ax, ends[k, 3] - ay
            within = reaches[k]
            if (
                max(ax, ax + bx) < low_x - within
                or min(ax, ax + bx) > high_x + within
                or max(ay, ay + by) < low_y - within
                or min(ay, ay + by) > high_y + within
            ):
                continue
            squared = max(bx * bx + by * by, 1e-12)
            for n in range(begin, end):
                x, y = points[n, 0] - ax, points[n, 1] - ay
                t = min(max((x * bx + y * by) / squared, 0.0), 1.0)
                dx, dy = x - t * bx, y - t * by
                if dx * dx + dy * dy < within * within:
                    found[n] = 1


def places_on(rows: Structured, count: int) -> Floats:
    """Return places along surfaces, shape (n · count, 2), m."""
    ends = ends_of(rows)
    shares = (np.arange(count) + 0.5) / count
    return (ends[:, None, :2] + shares[:, None] * (ends[:, None, 2:] - ends[:, None, :2])).reshape(-1, 2)


def is_covered(rows: Structured, by: Structured) -> NDArray[np.bool_]:
    """Return which surfaces lie along others, shape (n,); a polyline covers no straight piece, which says more."""
    covered = np.zeros(len(rows), np.bool_)
    for which, others in ((rows["number"] < 0, by[by["number"] < 0]), (rows["number"] >= 0, by)):
        found = np.zeros(int(which.sum()) * COMPARED, np.int64)
        find_near(places_on(rows[which], COMPARED), ends_of(others), np.full(len(others), AGREES_M), found)
        covered[which] = found.reshape(-1, COMPARED).all(axis=1)
    return covered


class SurfaceList:
    """Rows of surfaces."""

    BOUNDS: Final = bounds(archived_rows=Surface.BOUNDS, numbered=COUNT)

    def __init__(self) -> None:
        self.archived_rows = zeros(Surface, 0)
        """(n,): all of them."""
        self.numbered = 0
        """Pieces and polylines that have got a number."""

    @property
    def left_behind(self) -> Structured:
        """Those that are not of the present local map."""
        return np.asarray(self.archived_rows[self.archived_rows["is_live"] == 0])

    def replace_live(self, rows: Structured) -> None:
        """Replace those of the present local map; what they show anew is no longer among those left behind."""
        behind = self.left_behind
        behind = behind[~is_covered(behind, rows)]
        # A part of what stays says less than the whole.
        self.archived_rows = np.concatenate([behind, rows[~is_covered(rows, behind)]])

    def move(self, moves: MapMoves) -> None:
        """Move each with its map of the way."""
        rows = self.archived_rows
        for x, y in (("x1", "y1"), ("x2", "y2")):
            rows[x], rows[y], _ = moves.moved(rows["submap"], rows[x], rows[y])

    def leave(self) -> None:
        """Leave all behind: another local map begins."""
        self.archived_rows["is_live"] = 0

    def clear(self) -> None:
        """Forget everything but how many have got a number."""
        self.archived_rows = zeros(Surface, 0)
