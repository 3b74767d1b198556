"""Vacant areas: places of which the operator said that nothing stands there.

Nothing in such a place is reported, whatever it resembles and however much speaks for it, until the operator lifts
the area. The methods go on underneath: an object that was rejected by mistake is back at once, with its number.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from perception.bounds import COUNT, PLACE, bounds, up_to
from perception.detected_object import DetectedObject
from perception.map_moves import MapMoves
from perception.polyline import Polyline
from perception.shared_numbers import NO_NUMBER

AREAS_MAX: Final = 64
"""Greatest number of areas."""
RADIUS_MIN_M: Final = 0.3
"""Least radius of an area around a rejected object: another fit of the same readings lies a decimetre beside it."""
RADIUS_MAX_M: Final = 10.0
"""Largest radius of a vacant area, m."""
NO_ROOM: Final = f"{AREAS_MAX} areas are marked as vacant, the most there is room for: lift one first"

AREA: Final = np.dtype(
    [("x", np.float64), ("y", np.float64), ("radius", np.float64), ("number", np.int64), ("object", np.int64)]
)
"""An area: its circle, m; its number; number of the object that was rejected there, or `NO_NUMBER`."""


class VacantArea(NamedTuple):
    """A circle in which nothing stands."""

    number: int
    """Never given twice."""
    x: float
    """m"""
    y: float
    """m"""
    radius: float
    """m"""
    object: int = NO_NUMBER
    """Number of the object that was rejected there, or `NO_NUMBER`."""


class VacantAreas:
    """The areas of one map."""

    BOUNDS: Final = bounds(
        rows={"x": PLACE, "y": PLACE, "radius": PLACE, "number": COUNT, "object": COUNT},
        count=up_to(AREAS_MAX),
        last=COUNT,
    )

    def __init__(self) -> None:
        self.rows = np.zeros(AREAS_MAX, AREA)
        """(AREAS_MAX,): the first `count` are valid."""
        self.count = 0
        self.last = 0
        """Number of areas, and the number that was given last."""
        self._archived: tuple[DetectedObject, ...] = ()
        self._archived_seen: tuple[DetectedObject, ...] = ()
        self._polylines: tuple[Polyline, ...] = ()
        self._polylines_seen: tuple[Polyline, ...] = ()

    def mark(self, x: float, y: float, radius: float, detected: int = NO_NUMBER) -> str | None:
        """Add an area; return None, or why there is no room for it.

        Parameters
        ----------
        x, y, radius : float
            m.
        detected : int
            Number of the object that was rejected: it stays hidden although its place is refined.
        """
        if self.count == AREAS_MAX:
            return NO_ROOM
        self.last += 1
        self.rows[self.count] = (x, y, radius, self.last, detected)
        self.count += 1
        self.drop_caches()
        return None

    def restore(self, area: VacantArea) -> str | None:
        """Put back an area that was lifted; return None, or why that is impossible."""
        if not 0 < area.number <= self.last or area.number in self.rows["number"][: self.count]:
            return f"area {area.number} was not lifted"
        if self.count == AREAS_MAX:
            return NO_ROOM
        self.rows[self.count] = (area.x, area.y, area.radius, area.number, area.object)
        self.count += 1
        self._keep(np.argsort(self.rows["number"][: self.count]))
        return None

    def lift(self, number: int) -> bool:
        """Remove the area of this number; return whether there is one."""
        found = np.flatnonzero(self.rows["number"][: self.count] == number)
        self._keep(np.delete(np.arange(self.count), found))
        return len(found) > 0

    def lift_at(self, x: float, y: float) -> None:
        """Remove the areas that contain a place (m): the operator put an object there."""
        self._keep(np.flatnonzero(~self._contain(x, y)))

    def follow_maps(self, _submap: int, moves: MapMoves | None) -> None:
        """Move each area with the map of the way that is nearest to it, if these have moved."""
        rows = self.rows[: self.count]
        if moves is not None and len(rows):
            rows["x"], rows["y"], _ = moves.moved(moves.nearest(rows["x"], rows["y"]), rows["x"], rows["y"])
            self.drop_caches()

    def listed(self) -> tuple[VacantArea, ...]:
        """Return the areas, oldest first."""
        rows = self.rows[: self.count].tolist()
        return tuple(VacantArea(number, x, y, radius, rejected) for x, y, radius, number, rejected in rows)

    def hides(self, seen: DetectedObject) -> bool:
        """Return whether an object was rejected or lies in an area, a wall with both its ends; corners never do."""
        if seen.number is None:
            return False
        by_number = seen.number in self.rows["object"][: self.count]
        x1, y1, x2, y2 = seen.ends or (seen.x, seen.y, seen.x, seen.y)
        return bool(by_number or (self._contain(x1, y1) & self._contain(x2, y2)).any())

    def outside(self, objects: tuple[DetectedObject, ...]) -> tuple[DetectedObject, ...]:
        """Return the objects that are in no area; the same tuple where there is no area."""
        return objects if self.count == 0 else tuple(seen for seen in objects if not self.hides(seen))

    def archived_outside(self, archived: tuple[DetectedObject, ...]) -> tuple[DetectedObject, ...]:
        """Return the same of the objects left behind, which may be many; the same tuple until they change."""
        if self.count == 0:
            return archived
        if archived is not self._archived:
            self._archived, self._archived_seen = archived, self.outside(archived)
        return self._archived_seen

    def polylines_outside(self, polylines: tuple[Polyline, ...]) -> tuple[Polyline, ...]:
        """Return the polylines of which no area contains all points; the same tuple until they change."""
        if self.count == 0:
            return polylines
        if polylines is not self._polylines:
            self._polylines = polylines
            self._polylines_seen = tuple(one for one in polylines if not self._contain_all(one))
        return self._polylines_seen

    def clear(self) -> None:
        """Remove all areas; their numbers are not given again."""
        self._keep(np.zeros(0, np.int64))

    def drop_caches(self) -> None:
        """Discard what was derived from the areas."""
        self._archived = self._archived_seen = ()
        self._polylines = self._polylines_seen = ()

    def _contain(self, x: float, y: float) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        rows = self.rows[: self.count]
        return np.hypot(rows["x"] - x, rows["y"] - y) <= rows["radius"]

    def _contain_all(self, polyline: Polyline) -> bool:
        return bool(np.all([self._contain(x, y) for x, y in polyline.points.tolist()], axis=0).any())

    def _keep(self, kept: np.ndarray[tuple[int], np.dtype[np.int64]]) -> None:
        self.rows[: len(kept)] = self.rows[kept]
        self.rows[len(kept) :] = 0
        self.count = len(kept)
        self.drop_caches()


def invalid_area(x: float, y: float, radius: float, coordinate_max_m: float) -> str | None:
    """Return why a circle (m) cannot be an area, None if it can."""
    if abs(x) <= coordinate_max_m and abs(y) <= coordinate_max_m and 0.0 < radius <= RADIUS_MAX_M:
        return None
    return (
        f"invalid area ({x:g} m, {y:g} m, radius {radius:g} m): the radius is above 0 and at most {RADIUS_MAX_M:g} m"
    )


def radius_of(reach_m: float) -> float:
    """Return the radius of the area that a rejected object leaves, whose model reaches this far, m."""
    return min(RADIUS_MAX_M, max(RADIUS_MIN_M, reach_m)) if math.isfinite(reach_m) else RADIUS_MIN_M
