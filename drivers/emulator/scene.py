"""A world file as arrays: circles, straight surfaces, and the corners where surfaces meet.

A corner is described by the open sectors round it, because it reflects sound differently to each side: seen from
inside a sector narrower than half a turn it is a concave corner, from a wider one a convex edge. A wall that ends on
another wall, or crosses it, makes corners as well.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from config.world import WorldConfig
from drivers.emulator.acoustics import CIRCLE, CORNER, SEGMENT, Records

JOIN_M = 1e-4
"""Surfaces whose end points are nearer than this meet: people type rounded numbers into world files."""
_FLAT_RAD = 1e-3
"""Two surfaces whose directions differ by less than this make no corner."""
_PARALLEL = 1e-12
"""Sine of the angle below which two sides count as parallel: rounding makes any crossing of theirs meaningless."""

_FAR_M = 1e6
"""Where objects wait that are not in the scene yet: beyond the range of any sensor."""

NOWHERE = (_FAR_M, _FAR_M, 0.0)
"""Such an object."""

_Point = tuple[float, float]
_Side = tuple[_Point, _Point]


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What reflects sound and stops the body, in world coordinates; types of records as in `acoustics`.

    Attributes
    ----------
    circles
        `CIRCLE`, shape (circles,).
    segments
        `SEGMENT`, shape (segments,).
    corners
        `CORNER`, shape (sectors,).
    """

    circles: Records
    segments: Records
    corners: Records


def compile_scene(world: WorldConfig, later: int = 0) -> Scene:
    """Return the surfaces of `world`; a surface shorter than `JOIN_M` is left out.

    The last `later` of the circles are far away: a drum that appears later takes the place of one.
    """
    sides = [((x1, y1), (x2, y2)) for x1, y1, x2, y2 in world.sides_m()]
    sides = [(a, b) for a, b in sides if math.dist(a, b) > JOIN_M]
    return Scene(
        circles=np.array(
            [(drum.x_m, drum.y_m, drum.radius_m) for drum in world.drum] + later * [NOWHERE], dtype=CIRCLE
        ),
        segments=np.array([(*a, *b) for a, b in sides], dtype=SEGMENT),
        corners=np.array(_sectors(sides), dtype=CORNER),
    )


def _sectors(sides: list[_Side]) -> list[tuple[float, ...]]:
    """Return the open sectors round every point where a side ends or two sides cross."""
    rows: list[tuple[float, ...]] = []
    boxes = _Boxes(sides)
    for x, y in _meeting_points(sides, boxes):
        directions = _directions_from((x, y), [sides[i] for i in boxes.near((x, y), (x, y))])
        for i, start in enumerate(directions):
            end = directions[(i + 1) % len(directions)]
            opening = (end - start) % (2.0 * math.pi) or 2.0 * math.pi
            if abs(opening - math.pi) > _FLAT_RAD:
                rows.append((x, y, start, opening))
    return rows


class _Boxes:
    """The rectangles round all sides, so that a building's hundreds are not compared each with each."""

    def __init__(self, sides: list[_Side]) -> None:
        ends = np.array(sides, dtype=np.float64).reshape(-1, 2, 2)
        self._low, self._high = ends.min(axis=1) - JOIN_M, ends.max(axis=1) + JOIN_M

    def near(self, a: _Point, b: _Point) -> list[int]:
        """Return the sides, in turn, whose rectangle is within `JOIN_M` of the rectangle of two points."""
        low, high = np.minimum(a, b) - JOIN_M, np.maximum(a, b) + JOIN_M
        near: list[int] = ((self._low <= high) & (self._high >= low)).all(axis=1).nonzero()[0].tolist()
        return near


def _meeting_points(sides: list[_Side], boxes: _Boxes) -> list[_Point]:
    """Return the ends of all sides and where they cross; of those nearer than `JOIN_M` to one another the first."""
    crossings = [
        p
        for i, side in enumerate(sides)
        for k in boxes.near(*side)
        if k < i and (p := _crossing(side, sides[k])) is not None
    ]
    found: list[_Point] = []
    squares: dict[tuple[int, int], list[_Point]] = {}
    for point in [end for side in sides for end in side] + crossings:
        column, row = math.floor(point[0] / JOIN_M), math.floor(point[1] / JOIN_M)
        around = (squares.get((i, k), ()) for i in range(column - 1, column + 2) for k in range(row - 1, row + 2))
        if all(math.dist(point, other) > JOIN_M for others in around for other in others):
            found.append(point)
            squares.setdefault((column, row), []).append(point)
    return found


def _crossing(first: _Side, second: _Side) -> _Point | None:
    (ax, ay), (bx, by) = first
    (cx, cy), (dx, dy) = second
    ux, uy, vx, vy = bx - ax, by - ay, dx - cx, dy - cy
    across = ux * vy - uy * vx
    if abs(across) < _PARALLEL * math.hypot(ux, uy) * math.hypot(vx, vy):
        return None
    t = ((cx - ax) * vy - (cy - ay) * vx) / across
    s = ((cx - ax) * uy - (cy - ay) * ux) / across
    return (ax + t * ux, ay + t * uy) if 0.0 <= t <= 1.0 and 0.0 <= s <= 1.0 else None


def _directions_from(point: _Point, sides: list[_Side]) -> list[float]:
    """Return the directions in which surface leaves `point`, ascending, each once."""
    directions: list[float] = []
    for a, b in sides:
        if _distance_to_side(point, a, b) > JOIN_M:
            continue
        for end in (a, b):
            if math.dist(point, end) > JOIN_M:
                direction = math.atan2(end[1] - point[1], end[0] - point[0]) % (2.0 * math.pi)
                if all(_angle_between(direction, other) > _FLAT_RAD for other in directions):
                    directions.append(direction)
    return sorted(directions)


def _angle_between(a: float, b: float) -> float:
    return abs((a - b + math.pi) % (2.0 * math.pi) - math.pi)


def _distance_to_side(point: _Point, a: _Point, b: _Point) -> float:
    ux, uy = b[0] - a[0], b[1] - a[1]
    along = ((point[0] - a[0]) * ux + (point[1] - a[1]) * uy) / (ux * ux + uy * uy)
    along = min(1.0, max(0.0, along))
    return math.dist(point, (a[0] + along * ux, a[1] + along * uy))
