"""A local map: the readings of a few metres of way, their cells, and the search for surfaces in steps.

`keep` takes a firing and costs almost nothing. `LocalMapSearch.refine` does one quantum: it enters readings, shares
earlier echoes again, or does a part of a search for surfaces. A search sees the cells as they were when it began.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from drivers.messages import Firing
from perception.bounds import bounds
from perception.kernel import Floats, Ints
from perception.map_moves import MapMoves
from perception.mapping.surfaces.cells import make_again
from perception.mapping.surfaces.parameters import CELL_M, CELLS, LAST_REVISITS, REACH_M, READINGS_KEPT
from perception.mapping.surfaces.piece_fit import group_echoes
from perception.mapping.surfaces.pieces import order_cells
from perception.mapping.surfaces.quantum import (
    CAPTURE,
    CLEAR,
    IDLE,
    LOCATE,
    do_quantum,
    end_search,
    has_left,
    is_due,
    keep,
    leave,
)
from perception.mapping.surfaces.records import CellCounts, LocalMap
from perception.records import Structured, records, zeros


class LocalMapSearch:
    """A local map and the search in it.

    Parameters
    ----------
    half : float
        Half of the beam's opening, rad.
    range_max : float
        Ranges from this on are silence, m.
    radii : (k,) float
        Radii of the models, m.
    """

    SCRATCH: Final = ("room", "_counts", "_c", "_half", "_range_max", "radii")
    BOUNDS: Final = bounds(local=LocalMap.BOUNDS)

    def __init__(self, half: float, range_max: float, radii: Floats) -> None:
        self.local = zeros(LocalMap, 1)
        self.room = records(LocalMap, self.local)
        self._half, self._range_max = half, range_max
        self.radii = radii
        """Radii of the models, m."""
        self._clear_counts()

    def _clear_counts(self) -> None:
        # Memory that was never written costs nothing.
        self._counts = zeros(CellCounts, 1)
        self._c = records(CellCounts, self._counts)

    @property
    def centre(self) -> tuple[float, float]:
        """The map's centre, m."""
        return float(self.local["centre_x"][0]), float(self.local["centre_y"][0])

    @property
    def quanta_left(self) -> int:
        """Quanta that are left after the last firing."""
        return int(self.local["left"][0])

    @quanta_left.setter
    def quanta_left(self, left: int) -> None:
        self.local["left"] = left

    @property
    def is_due(self) -> bool:
        """Whether `refine` has anything to do."""
        return is_due(self.room)

    def has_left(self, x: float, y: float) -> bool:
        """Return whether a robot at a place (m) needs another local map; before, this one is searched once more."""
        return has_left(self.room, x, y)

    def keep(self, firing: Firing, mounts: Floats) -> None:
        """Keep what a firing says anew."""
        pose = np.array([firing.pose.x, firing.pose.y, firing.ring_yaw])
        keep(self.room, mounts, pose, firing.ranges_m, self._range_max)

    def begin_at(self, x: float, y: float) -> None:
        """Begin another local map with a centre at a place (m), and the newest readings from around it."""
        end_search(self.room, self._c)
        room, half = self.local[0], 0.5 * CELLS * CELL_M - REACH_M
        count, entered = int(room["count"]), int(room["entered"])
        dx, dy = float(room["centre_x"]) - x, float(room["centre_y"]) - y
        readings = room["readings"][:count]
        kept = np.flatnonzero((np.abs(readings["x"] + dx) < half) & (np.abs(readings["y"] + dy) < half))
        kept = kept[-READINGS_KEPT:]
        readings[: len(kept)] = readings[kept]
        readings[len(kept) :].view(np.uint8)[...] = 0
        readings["x"][: len(kept)] += dx
        readings["y"][: len(kept)] += dy
        for name in ("entered", "revisited", "owed", "swept", "is_left"):
            room[name] = 0
        room["count"], room["carried"] = len(kept), np.count_nonzero(kept < entered)
        room["centre_x"], room["centre_y"] = x, y
        room["phase"] = CLEAR

    def move(self, moves: MapMoves) -> None:
        """Move each reading with its map of the way; the cells are made anew, and all echoes shared again."""
        end_search(self.room, self._c)
        room, (x, y) = self.local[0], self.centre
        readings = room["readings"][: int(room["count"])]
        at_x, at_y, turn = moves.moved(readings["submap"], readings["x"] + x, readings["y"] + y)
        readings["x"], readings["y"] = at_x - x, at_y - y
        readings["axis"] += turn
        last = np.full(len(room["kept_x"]), len(moves.motions) - 1)
        room["kept_x"], room["kept_y"], turn = moves.moved(last, room["kept_x"], room["kept_y"])
        room["kept_axis"] += turn
        room["carried"] = max(room["carried"], room["entered"])
        for name in ("entered", "revisited", "swept"):
            room[name] = 0
        room["owed"] = max(room["owed"], LAST_REVISITS * room["carried"])
        room["phase"] = CLEAR

    def submaps(self, x: Floats, y: Floats) -> Ints:
        """Return the map of the way whose readings were taken nearest to each place (m), shape (n,)."""
        readings = self.local["readings"][0, : int(self.local["count"][0])]
        numbers, of, counts = np.unique(readings["submap"], return_inverse=True, return_counts=True)
        middle_x, middle_y = (np.bincount(of, readings[name]) / counts for name in ("x", "y"))
        away = np.hypot(x[:, None] - self.centre[0] - middle_x, y[:, None] - self.centre[1] - middle_y)
        return np.asarray(numbers[away.argmin(axis=1)])

    def refine(self) -> bool:
        """Do one quantum; return whether it ended a search, whose surfaces are there until the next quantum."""
        return do_quantum(self.room, self._c, self._half, self.radii)

    def finish(self) -> bool:
        """Enter everything that was kept and search once more; return whether there was anything new."""
        room = self.local
        leave(self.room)
        while room["phase"][0] != IDLE or room["entered"][0] < room["count"][0] or room["owed"][0] > 0:
            self.refine()
        room["is_left"] = 0
        if room["entered"][0] == 0:
            return False
        while not self.refine():
            pass
        return True

    def pieces(self) -> Structured:
        """Return the pieces that the last search has found, as records of `Piece`."""
        room = self.local[0]
        return room["pieces"][: int(room["piece_count"])]

    def chains(self) -> tuple[Structured, Ints]:
        """Return the cells of the last search's polylines, as records of `SurfaceCell`, and each one's number."""
        room = self.local[0]
        numbers = room["chains"][: int(room["chained"])]
        is_cell = numbers > 0
        return room["cells"][numbers[is_cell] - 1], np.cumsum(~is_cell)[is_cell]

    def contradiction(self) -> str | None:
        """Return what would take away from the cells what is not in them, None if nothing does."""
        room = self.local[0]
        if room["phase"] == CLEAR and room["entered"] > 0:
            return f"local.entered is {room['entered']}, but its cells are being cleared"
        return None

    def drop_caches(self) -> None:
        """Make the cells again after the memory was overwritten."""
        self._clear_counts()
        make_again(self.room, self._c, self._half)
        room = self.local[0]
        cells = room["cells"][: int(room["cell_count"])]
        self._counts["index"][0, cells["i"], cells["j"]] = np.arange(1, len(cells) + 1)
        if CAPTURE < room["phase"] < CLEAR:
            order_cells(self.room, self._c)
        if LOCATE < room["phase"] < CLEAR:
            group_echoes(self.room, self._c)

    def clear(self) -> None:
        """Forget everything."""
        self.local.view(np.uint8)[...] = 0
        self._clear_counts()
