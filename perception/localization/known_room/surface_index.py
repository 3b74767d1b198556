"""An index of a room's surfaces by place: each bin lists what sensors in it can hear, so that maps may be large."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from perception.kernel import Floats, Ints, kernel
from perception.localization.room.room import Room
from perception.records import Record, Records, Structured, zeros

INDEX_BIN_M: Final = 4.0
"""Edge of a bin of the index: each lists what sensors at its places can hear."""
WITHIN_M: Final = 2.0
"""The lists are good for sensors up to this far from a place in the bin."""
WALLS, CORNERS, CIRCLES = range(3)
"""Kinds of surfaces in the index."""


class Bins(Record):
    """The index's bins: lower left corner (m), and their number along x and y."""

    low_x: float
    low_y: float
    columns: int
    rows: int


def make_index(room: Room, window_m: float) -> tuple[Structured, Ints, Ints]:
    """Return the index of a room's surfaces.

    Parameters
    ----------
    room : Room
        The surfaces.
    window_m : float
        Greatest range of a sensor, m.

    Returns
    -------
    ((1,) Bins, (m,) int, (n,) int)
        Bins, starts and items: the surfaces of one kind in one bin are the items from start k to before start k + 1,
        where k is (kind · columns + column) · rows + row.
    """
    low, high = room.bounds
    columns, rows = (max(1, math.ceil(side / INDEX_BIN_M)) for side in (high - low).tolist())
    bins = zeros(Bins, 1)
    bins[0] = (*low.tolist(), columns, rows)
    reach_m = window_m + WITHIN_M + INDEX_BIN_M / math.sqrt(2.0)
    lists: list[Ints] = []
    for kind in (WALLS, CORNERS, CIRCLES):
        for column in range(columns):
            for row in range(rows):
                x, y = (low + INDEX_BIN_M * (np.array([column, row]) + 0.5)).tolist()
                lists.append(np.flatnonzero(_distances(room, kind, x, y) <= reach_m))
    starts = np.concatenate([[0], np.cumsum([len(found) for found in lists])]).astype(np.int64)
    return bins, starts, np.concatenate(lists).astype(np.int64)


def _distances(room: Room, kind: int, x: float, y: float) -> Floats:
    """Return the distances of all surfaces of a kind from a place, m."""
    if kind == WALLS:
        along = room.walls[:, 2:] - room.walls[:, :2]
        off = (x, y) - room.walls[:, :2]
        share = np.clip((off * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
        nearest = off - share[:, None] * along
        return np.asarray(np.hypot(nearest[:, 0], nearest[:, 1]))
    if kind == CORNERS:
        return np.asarray(np.hypot(room.corners[:, 0] - x, room.corners[:, 1] - y))
    return np.asarray(np.hypot(room.circles[:, 0] - x, room.circles[:, 1] - y) - room.circles[:, 2])


@kernel
def listed(of: Records[Bins], starts: Ints, kind: int, x: float, y: float, within_m: float) -> tuple[int, int]:
    """Return where in the index the surfaces of a kind near a place begin and end; -1, -1 where it does not reach.

    Parameters
    ----------
    of : (1,) Bins
        The index's bins, from `make_index`.
    starts : (n,) int
        And its starts.
    kind : int
        `WALLS`, `CORNERS` or `CIRCLES`.
    x, y : float
        The place, m.
    within_m : float
        Greatest distance of a sensor from it, m.
    """
    bins = of[0]
    column, row = math.floor((x - bins.low_x) / INDEX_BIN_M), math.floor((y - bins.low_y) / INDEX_BIN_M)
    if within_m > WITHIN_M or not 0 <= column < bins.columns or not 0 <= row < bins.rows:
        return -1, -1
    n = (kind * bins.columns + column) * bins.rows + row
    return starts[n], starts[n + 1]
