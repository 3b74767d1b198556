"""A world file as arrays: circles, straight surfaces, and the corners where surfaces meet.

A corner is described by the open sectors round it, because it reflects sound differently to each side: seen from
inside a sector narrower than half a turn it is a concave corner, from a wider one a convex edge. A wall that ends on
another wall, or crosses it, makes corners as well.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from config.world import Surface, WorldConfig
from drivers.emulator.surfaces import AS_WORLD, CIRCLE, CORNER, SEGMENT, SURFACES, Records

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
_Side = tuple[_Point, _Point, int]
"""Both ends of a straight surface, and how it answers: a model of `surfaces`, or `AS_WORLD`."""


class Scene(NamedTuple):
    """What reflects sound and stops the body, in world coordinates, as kernels take it; records as in `surfaces`."""

    circles: Records
    """`CIRCLE`, shape (circles,)."""
    segments: Records
    """`SEGMENT`, shape (segments,)."""
    corners: Records
    """`CORNER`, shape (sectors,)."""


def compile_scene(world: WorldConfig, later: int = 0) -> Scene:
    """Return the surfaces of `world`; a surface shorter than `JOIN_M` is left out.

    The last `later` of the circles are far away: a drum that appears later takes the place of one.
    """
    sides = [side for side in _sides(world) if math.dist(side[0], side[1]) > JOIN_M]
    drums = [(drum.x_m, drum.y_m, drum.radius_m, _answers(drum.surface)) for drum in world.drum]
    return Scene(
        circles=np.array(drums + later * [(*NOWHERE, AS_WORLD)], dtype=CIRCLE),
        segments=np.array([(*a, *b, surface) for a, b, surface in sides], dtype=SEGMENT),
        corners=np.array(_sectors(sides) + _bends(world), dtype=CORNER),
    )


def _answers(surface: Surface | None) -> int:
    return AS_WORLD if surface is None else SURFACES[surface]


def _sides(world: WorldConfig) -> list[_Side]:
    """Return the straight surfaces of walls, boxes and polygons."""
    sides = [
        ((x1, y1), (x2, y2), _answers(wall.surface)) for wall in world.wall for x1, y1, x2, y2 in wall.pieces_m()
    ]
    for box in world.box:
        sides += _outline(box.corners_m(), _answers(box.surface))
    for polygon in world.polygon:
        sides += _outline(list(polygon.vertices_m), _answers(polygon.surface))
    return sides


def _outline(vertices: list[_Point], surface: int) -> list[_Side]:
    return [(a, b, surface) for a, b in zip(vertices, vertices[1:] + vertices[:1], strict=True)]


def _bends(world: WorldConfig) -> list[tuple[float, ...]]:
    """Return the sectors in which the joints of bent walls answer: between the normals of the pieces that meet there.

    A smooth bend answers wherever its normal looks back; of its straight pieces, those seen from their outer side do
    not between two of their normals.
    """
    rows: list[tuple[float, ...]] = []
    for wall in world.wall:
        pieces = wall.pieces_m()
        directions = [math.atan2(y2 - y1, x2 - x1) for x1, y1, x2, y2 in pieces]
        for (_, _, x, y), before, after in zip(pieces, directions, directions[1:], strict=False):
            turn = (after - before + math.pi) % (2.0 * math.pi) - math.pi
            # Turning left, the outer side is on the right.
            start = before - 0.5 * math.pi if turn > 0.0 else after + 0.5 * math.pi
            rows.append((x, y, start, abs(turn), _answers(wall.surface), _answers(wall.surface)))
    return rows


def _sectors(sides: list[_Side]) -> list[tuple[float, ...]]:
    """Return the open sectors round every point where a side ends or two sides cross."""
    rows: list[tuple[float, ...]] = []
    boxes = _Boxes(sides)
    for x, y in _meeting_points(sides, boxes):
        directions = _directions_from((x, y), [sides[i] for i in boxes.near((x, y), (x, y))])
        for i, (start, surface) in enumerate(directions):
            end, beside = directions[(i + 1) % len(directions)]
            opening = (end - start) % (2.0 * math.pi) or 2.0 * math.pi
            if abs(opening - math.pi) > _FLAT_RAD:
                rows.append((x, y, start, opening, surface, beside))
    return rows


class _Boxes:
    """The rectangles round all sides, so that a building's hundreds are not compared each with each."""

    def __init__(self, sides: list[_Side]) -> None:
        ends = np.array([side[:2] for side in sides], dtype=np.float64).reshape(-1, 2, 2)
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
        for k in boxes.near(side[0], side[1])
        if k < i and (p := _crossing(side, sides[k])) is not None
    ]
    found: list[_Point] = []
    squares: dict[tuple[int, int], list[_Point]] = {}
    for point in [end for side in sides for end in side[:2]] + crossings:
        column, row = math.floor(point[0] / JOIN_M), math.floor(point[1] / JOIN_M)
        around = (squares.get((i, k), ()) for i in range(column - 1, column + 2) for k in range(row - 1, row + 2))
        if all(math.dist(point, other) > JOIN_M for others in around for other in others):
            found.append(point)
            squares.setdefault((column, row), []).append(point)
    return found


def _crossing(first: _Side, second: _Side) -> _Point | None:
    """Return the point that two sides have in common; None if they are parallel or do not meet."""
    (ax, ay), (bx, by), _ = first
    (cx, cy), (dx, dy), _ = second
    ux, uy, vx, vy = bx - ax, by - ay, dx - cx, dy - cy
    across = ux * vy - uy * vx
    if abs(across) < _PARALLEL * math.hypot(ux, uy) * math.hypot(vx, vy):
        return None
    t = ((cx - ax) * vy - (cy - ay) * vx) / across
    s = ((cx - ax) * uy - (cy - ay) * ux) / across
    return (ax + t * ux, ay + t * uy) if 0.0 <= t <= 1.0 and 0.0 <= s <= 1.0 else None


def _directions_from(point: _Point, sides: list[_Side]) -> list[tuple[float, int]]:
    """Return the directions in which surface leaves `point`, ascending, each once, and how it answers."""
    directions: list[tuple[float, int]] = []
    for a, b, surface in sides:
        if _distance_to_side(point, a, b) > JOIN_M:
            continue
        for end in (a, b):
            if math.dist(point, end) > JOIN_M:
                direction = math.atan2(end[1] - point[1], end[0] - point[0]) % (2.0 * math.pi)
                if all(_angle_between(direction, other) > _FLAT_RAD for other, _ in directions):
                    directions.append((direction, surface))
    return sorted(directions)


def _angle_between(a: float, b: float) -> float:
    return abs((a - b + math.pi) % (2.0 * math.pi) - math.pi)


def _distance_to_side(point: _Point, a: _Point, b: _Point) -> float:
    """Return the distance of a point from the side between two others, m."""
    ux, uy = b[0] - a[0], b[1] - a[1]
    along = ((point[0] - a[0]) * ux + (point[1] - a[1]) * uy) / (ux * ux + uy * uy)
    along = min(1.0, max(0.0, along))
    return math.dist(point, (a[0] + along * ux, a[1] + along * uy))
