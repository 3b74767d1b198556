"""A known room: its walls, the sectors between them at every corner, and its round objects."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.world import WorldConfig
from perception.kernel import Floats

JOIN_M: Final = 1e-3
"""Ends of walls nearer than this to each other, or to a wall, meet there."""
FLAT_RAD: Final = 1e-3
"""Two walls that differ from a straight continuation by less than this make no corner."""


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """The surfaces of a room in the map frame."""

    walls: Floats
    """(w, 4): both ends x1, y1, x2, y2 of each wall, m. A wall reflects on both sides."""
    normals: Floats
    """(w, 2): unit normal of each wall: its direction turned counter-clockwise by a quarter."""
    offsets: Floats
    """(w,): normal · point for the points of each wall, m."""
    corners: Floats
    """(c, 4): one row for each sector between successive walls that leave a point: x, y (m), the direction in which
    the sector starts, and its opening counter-clockwise (rad). Below π it is a concave corner, above a convex edge;
    2π at the free end of a wall."""
    circles: Floats
    """(k, 3): centre x, y and radius of each round object, m."""

    @property
    def area_m2(self) -> float:
        """Area of the rectangle around the room, m²."""
        low, high = self.bounds
        return float(np.prod(high - low))

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """The lower left and the upper right corner of the rectangle around the room, m, shape (2,) each."""
        ends = self.walls.reshape(-1, 2)
        centres, radii = self.circles[:, :2], self.circles[:, 2:]
        points = np.concatenate([ends, centres - radii, centres + radii])
        return points.min(axis=0), points.max(axis=0)


def make_room(walls: Floats, circles: Floats | None = None) -> Room:
    """Return the room with these walls and round objects.

    Parameters
    ----------
    walls : (w, 4) float
        Both ends of each wall, m. Walls that cross should be split at the crossing; otherwise it is no corner.
    circles : (k, 3) float, optional
        Centre and radius of each round object, m.

    Raises
    ------
    ValueError
        An array has another shape, there is no row at all, a value is not finite, a radius is not positive, or a wall
        is shorter than `JOIN_M`.
    """
    walls = np.array(walls, dtype=np.float64)
    circles = np.empty((0, 3)) if circles is None else np.array(circles, dtype=np.float64)
    if walls.ndim != 2 or walls.shape[1] != 4 or not np.isfinite(walls).all() or not len(walls) + len(circles):
        raise ValueError("expected at least one wall as a row of four finite numbers: x1, y1, x2, y2")
    if circles.ndim != 2 or circles.shape[1] != 3 or not np.isfinite(circles).all() or (circles[:, 2] <= 0.0).any():
        raise ValueError("expected each circle as a row of three finite numbers: x, y, radius > 0")
    along = walls[:, 2:] - walls[:, :2]
    length = np.hypot(along[:, 0], along[:, 1])
    if len(walls) and length.min() < JOIN_M:
        raise ValueError(f"wall {int(length.argmin())} is shorter than {JOIN_M} m")
    normals = np.column_stack([-along[:, 1], along[:, 0]]) / length[:, None]
    offsets = (normals * walls[:, :2]).sum(axis=1)
    return Room(walls, normals, offsets, _sectors(walls, normals, offsets), circles)


def room_of(world: WorldConfig) -> Room:
    """Return the surfaces of a world as a known room; a side shorter than `JOIN_M` is left out.

    Raises
    ------
    ValueError
        It has no surface.
    """
    sides = [side for side in world.sides_m() if math.dist(side[:2], side[2:]) >= JOIN_M]
    circles = [(drum.x_m, drum.y_m, drum.radius_m) for drum in world.drum]
    return make_room(np.array(sides).reshape(-1, 4), np.array(circles).reshape(-1, 3))


def _sectors(walls: Floats, normals: Floats, offsets: Floats) -> Floats:
    """Return `Room.corners`, of walls as in `Room`: straight continuations are left out."""
    rows: list[tuple[float, float, float, float]] = []
    seen: list[tuple[float, float]] = []
    for x, y in walls.reshape(-1, 2).tolist():
        if all(math.dist((x, y), other) > JOIN_M for other in seen):
            seen.append((x, y))
            directions = _directions(x, y, walls, normals, offsets)
            for start, end in zip(directions, [*directions[1:], directions[0]], strict=True):
                opening = (end - start) % (2.0 * math.pi) or 2.0 * math.pi
                if abs(opening - math.pi) > FLAT_RAD:
                    rows.append((x, y, start, opening))
    return np.array(rows).reshape(-1, 4)


def _directions(x: float, y: float, walls: Floats, normals: Floats, offsets: Floats) -> list[float]:
    """Return the directions in which a wall leaves a point, ascending, each once."""
    along = np.column_stack([normals[:, 1], -normals[:, 0]])
    begin = ((walls[:, :2] - (x, y)) * along).sum(axis=1)
    end = ((walls[:, 2:] - (x, y)) * along).sum(axis=1)
    touches = (np.abs(normals @ (x, y) - offsets) < JOIN_M) & (begin < JOIN_M) & (end > -JOIN_M)
    leaving = np.concatenate([along[touches & (end > JOIN_M)], -along[touches & (begin < -JOIN_M)]])
    found: list[float] = []
    for direction in sorted(np.arctan2(leaving[:, 1], leaving[:, 0]).tolist()):
        if not found or (direction - found[-1] > FLAT_RAD and direction - found[0] < 2.0 * math.pi - FLAT_RAD):
            found.append(direction)
    return found
