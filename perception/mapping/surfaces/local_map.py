"""A local map: the readings of a few metres of way, their cells, and the search for surfaces in steps.

`keep` takes a firing and costs almost nothing. `LocalMapSearch.refine` does one quantum: it enters readings, shares
earlier echoes again, or does a part of a search for surfaces. A search sees the cells as they were when it began.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from drivers.messages import Firing
from perception.bounds import bounds
from perception.kernel import Floats, kernel
from perception.mapping.surfaces.cells import RIM, enter_readings, make_again, share_again
from perception.mapping.surfaces.parameters import (
    CELL_M,
    CELLS,
    LAST_REVISITS,
    LEFT_M,
    LEFT_MAX_M,
    REACH_M,
    READINGS_KEPT,
    READINGS_MAX,
    REVISITS,
    SPACING_M,
    SPACING_RAD,
)
from perception.mapping.surfaces.piece_fit import judge, locate_all
from perception.mapping.surfaces.pieces import capture, grow_all
from perception.mapping.surfaces.polylines import chain_all, choose_nodes
from perception.mapping.surfaces.records import CellCounts, LocalMap
from perception.records import records, zeros

SILENCE: Final = 1e6
"""Range of silence, m."""
ENTERED: Final = 4
SHARED: Final = 16
ROWS: Final = 32
TRIED: Final = 2
LOCATED: Final = 256
JUDGED: Final = 1
ORDERED: Final = 512
"""What a quantum does of each step: a twentieth of a millisecond."""
IDLE: Final = 0
CAPTURE: Final = 1
GROW: Final = 2
LOCATE: Final = 3
JUDGE: Final = 4
CHOOSE: Final = 5
CHAIN: Final = 6
"""Steps of a search, in their order."""
SEARCH_READINGS_MIN: Final = 64
SEARCH_SHARE: Final = 5
"""A search begins after so many new readings, or so large a part of all as one in this."""
STRENGTH_STEPS: Final = 256.0


@kernel
def keep(room: LocalMap, mounts: Floats, pose: Floats, ranges: Floats, range_max: float) -> None:
    """Append the readings of the sensors that have moved, while there is room.

    Parameters
    ----------
    room : LocalMap
        Updated.
    mounts : (n, 3) float
        x, y (m), direction (rad) of each sensor in the ring's frame.
    pose : (3,) float
        The ring's place (m) and direction (rad).
    ranges : (n,) float
        m; infinite for silence, NaN of a sensor that did not fire.
    range_max : float
        Ranges from this on are silence, m.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for k in range(len(ranges)):
        if not ranges[k] >= 0.0 or room.count >= READINGS_MAX:  # also true for NaN
            continue
        x = pose[0] + c * mounts[k, 0] - s * mounts[k, 1]
        y = pose[1] + s * mounts[k, 0] + c * mounts[k, 1]
        axis = pose[2] + mounts[k, 2]
        if room.is_kept[k] == 1:
            moved = math.hypot(x - room.kept_x[k], y - room.kept_y[k])
            turned = axis - room.kept_axis[k]
            if moved < SPACING_M and 2.0 * abs(math.sin(0.5 * turned)) < SPACING_RAD:
                continue
        room.is_kept[k] = 1
        room.kept_x[k], room.kept_y[k], room.kept_axis[k] = x, y, axis
        q = room.readings[room.count]
        q.x, q.y, q.axis = x - room.centre_x, y - room.centre_y, axis
        q.range_m = ranges[k] if ranges[k] < range_max else SILENCE
        room.count += 1


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
        # Memory that was never written costs nothing, and new memory less than to overwrite the old.
        self._counts = zeros(CellCounts, 1)
        self._c = records(CellCounts, self._counts)

    @property
    def centre(self) -> tuple[float, float]:
        """The map's centre, m."""
        return float(self.room[0].centre_x), float(self.room[0].centre_y)

    @property
    def quanta_left(self) -> int:
        """Quanta that are left after the last firing."""
        return int(self.room[0].left)

    @quanta_left.setter
    def quanta_left(self, left: int) -> None:
        self.room[0].left = left

    @property
    def is_due(self) -> bool:
        """Whether `refine` has anything to do."""
        room = self.room[0]
        return bool(room.entered < room.count or room.owed > 0 or room.phase != IDLE or self._search_is_due)

    @property
    def _search_is_due(self) -> bool:
        room = self.room[0]
        new = room.entered - room.swept
        return bool(new > 0 and (room.is_left == 1 or new >= max(SEARCH_READINGS_MIN, room.entered / SEARCH_SHARE)))

    def has_left(self, x: float, y: float) -> bool:
        """Return whether a robot at a place (m) needs another local map; before, this one is searched once more."""
        room = self.room[0]
        away = max(abs(x - room.centre_x), abs(y - room.centre_y))
        if room.is_left == 0 and room.count > 0 and (away > LEFT_M or room.count >= READINGS_MAX):
            self._leave()
        return bool(room.is_left == 1 and (away > LEFT_MAX_M or not self.is_due))

    def _leave(self) -> None:
        """Share all echoes again before the last search, by what the whole map says."""
        room = self.room[0]
        room.is_left = 1
        room.owed += LAST_REVISITS * room.count

    def keep(self, firing: Firing, mounts: Floats) -> None:
        """Keep what a firing says anew."""
        x, y, yaw = float(firing.pose.x), float(firing.pose.y), float(firing.ring_yaw)
        room = self.room[0]
        if room.count == 0:
            room.centre_x, room.centre_y = x, y
        keep(room, mounts, np.array([x, y, yaw]), firing.ranges_m, self._range_max)

    def begin_at(self, x: float, y: float) -> None:
        """Begin another local map with a centre at a place (m), and the newest readings from around it."""
        room, half = self.local[0], 0.5 * CELLS * CELL_M - REACH_M
        readings = room["readings"][: int(room["count"])]
        dx, dy = float(room["centre_x"]) - x, float(room["centre_y"]) - y
        is_near = (np.abs(readings["x"] + dx) < half) & (np.abs(readings["y"] + dy) < half)
        kept = readings[is_near][-READINGS_KEPT:].copy()
        kept["x"] += dx
        kept["y"] += dy
        room["readings"].view(np.uint8)[...] = 0
        room["readings"][: len(kept)] = kept
        room["count"] = len(kept)
        room["centre_x"], room["centre_y"] = x, y
        for name in ("entered", "revisited", "owed", "swept", "is_left"):
            room[name] = 0
        self._end_search()
        self._clear_counts()

    def refine(self) -> bool:
        """Do one quantum; return whether it ended a search, whose surfaces are there until the next quantum."""
        room, c = self.room[0], self._c[0]
        if room.phase == IDLE and room.entered < room.count:
            end = min(room.entered + ENTERED, room.count)
            enter_readings(c, room.readings, room.entered, end, self._half)
            room.owed += REVISITS * (end - room.entered)
            room.entered = end
            return False
        if room.phase == IDLE and room.owed > 0:
            begin = room.revisited if room.revisited < room.entered else 0
            end = min(begin + SHARED, room.entered)
            share_again(c, room.readings, begin, end, self._half)
            room.revisited = end
            room.owed = max(0, room.owed - SHARED)
            return False
        return self._search()

    def finish(self) -> bool:
        """Enter everything that was kept and search once more; return whether there was anything new."""
        room = self.room[0]
        if room.is_left == 0:
            self._leave()
        while room.phase != IDLE or room.entered < room.count or room.owed > 0:
            self.refine()
        room.is_left = 0
        if room.entered == 0:
            return False
        self._search()
        while not self._search():
            pass
        return True

    def _search(self) -> bool:
        room, c, at = self.room[0], self._c[0], int(self.room[0].at)
        if room.phase == IDLE:
            self._end_search()
            room.swept, room.phase = room.entered, CAPTURE
            return False
        if room.phase == CAPTURE:
            capture(room, c, RIM + at, min(RIM + at + ROWS, CELLS - RIM))
            if self._advance(ROWS, CELLS - 2 * RIM):
                self._order()
        elif room.phase == GROW:
            if grow_all(room, c, TRIED) < TRIED:
                room.phase, room.at = LOCATE, 0
        elif room.phase == LOCATE:
            locate_all(room, c, at, min(at + LOCATED, room.swept), self._half)
            self._advance(LOCATED, room.swept)
        elif room.phase == JUDGE:
            if at < room.piece_count:
                judge(room, at, self.radii)
            self._advance(JUDGED, room.piece_count)
        elif room.phase == CHOOSE:
            choose_nodes(room, c, at, min(at + ORDERED, room.cell_count))
            self._advance(ORDERED, room.cell_count)
        else:
            chain_all(room, c, at, min(at + ORDERED, room.cell_count))
            if self._advance(ORDERED, room.cell_count):
                room.phase = IDLE
                return True
        return False

    def _advance(self, by: int, end: int) -> bool:
        """Go on in the present step, or to the next one; return whether the step has ended."""
        room = self.room[0]
        room.at += by
        if room.at < end:
            return False
        room.phase, room.at = room.phase + 1, 0
        return True

    def _order(self) -> None:
        """Put the occupied cells in order, the strongest first."""
        count = int(self.room[0].cell_count)
        strengths = self.local["cells"]["strength"][0, :count]
        steps = np.minimum(strengths * STRENGTH_STEPS, np.iinfo(np.uint16).max).astype(np.uint16)
        self._counts["order"][0, :count] = np.argsort(np.iinfo(np.uint16).max - steps, kind="stable")

    def _end_search(self) -> None:
        room = self.local[0]
        for name in ("cells", "pieces", "points", "chains"):
            room[name].view(np.uint8)[...] = 0  # a keyframe holds nothing that is over
        for name in ("phase", "at", "cell_count", "piece_count", "chained"):
            room[name] = 0

    def pieces(self) -> NDArray[Any]:
        """Return the pieces that the last search has found, as records of `Piece`."""
        room = self.local[0]
        return room["pieces"][: int(room["piece_count"])]  # type: ignore[no-any-return]  # numpy types a field as Any

    def chains(self) -> list[NDArray[Any]]:
        """Return the cells of each polyline that the last search has found, as records of `SurfaceCell`."""
        room = self.local[0]
        numbers = room["chains"][: int(room["chained"])]
        ends = np.flatnonzero(numbers == 0)
        return [room["cells"][part[part > 0] - 1] for part in np.split(numbers, ends + 1) if (part > 0).any()]

    def drop_caches(self) -> None:
        """Make the cells again after the memory was overwritten."""
        self._clear_counts()
        room, c = self.room[0], self._c[0]
        make_again(c, room.readings, room.entered, self._half)
        count = int(room.cell_count)
        cells = self.local["cells"][0, :count]
        self._counts["index"][0, cells["i"], cells["j"]] = np.arange(1, count + 1)
        if room.phase > CAPTURE:
            self._order()

    def clear(self) -> None:
        """Forget everything."""
        self.local.view(np.uint8)[...] = 0
        self._clear_counts()
