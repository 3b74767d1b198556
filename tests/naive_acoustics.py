"""Slow, readable oracles for the emulator's acoustics: complex numbers, and every candidate listed.

They share no code with the product, not even the conversion of a world to surfaces.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np

from config.world import WorldConfig


@dataclass(frozen=True)
class Shapes:
    """The surfaces of a world: circles (centre, radius) and sides (both ends)."""

    circles: list[tuple[complex, float]]
    sides: list[tuple[complex, complex]]


def shapes_of(world: WorldConfig) -> Shapes:
    """Return the surfaces of a world."""
    outlines = []
    for box in world.box:
        turn = cmath.exp(1j * math.radians(box.angle_deg))
        w, d = box.width_m / 2, box.depth_m / 2
        corners = [complex(w, d), complex(-w, d), complex(-w, -d), complex(w, -d)]
        outlines.append([complex(box.x_m, box.y_m) + turn * corner for corner in corners])
    outlines += [[complex(x, y) for x, y in polygon.vertices_m] for polygon in world.polygon]
    sides = [(complex(wall.x1_m, wall.y1_m), complex(wall.x2_m, wall.y2_m)) for wall in world.wall]
    for outline in outlines:
        sides += [(outline[k - 1], outline[k]) for k in range(len(outline))]
    return Shapes([(complex(d.x_m, d.y_m), d.radius_m) for d in world.drum], sides)


def in_beam(point: complex, sensor: complex, axis: float, half_angle: float, margin: float = 0.0) -> bool:
    """Return whether a point lies in the beam, widened by `margin` (rad) on either side."""
    return abs(cmath.phase((point - sensor) * cmath.exp(-1j * axis))) <= half_angle + margin


def _line_hits_side(origin: complex, direction: complex, a: complex, b: complex) -> float | None:
    """Return the distance along `direction` at which the side is crossed, None where it is not."""
    matrix = np.array([[direction.real, (a - b).real], [direction.imag, (a - b).imag]])
    if abs(np.linalg.det(matrix)) < 1e-12:
        return None
    along, share = np.linalg.solve(matrix, [(a - origin).real, (a - origin).imag])
    return float(along) if -1e-12 <= share <= 1 + 1e-12 else None


def _line_hits_circle(origin: complex, direction: complex, centre: complex, radius: float) -> list[float]:
    """Return the distances along `direction` (a unit vector) at which the circle is crossed."""
    linear = -2 * ((centre - origin) * direction.conjugate()).real
    constant = abs(centre - origin) ** 2 - radius**2
    discriminant = linear**2 - 4 * constant
    if discriminant < 0:
        return []
    return [(-linear - math.sqrt(discriminant)) / 2, (-linear + math.sqrt(discriminant)) / 2]


def foot_on_line(point: complex, a: complex, b: complex) -> tuple[complex, float]:
    """Return the foot of the perpendicular and its position along the side (0 to 1 on it)."""
    share = ((point - a) / (b - a)).real
    return a + share * (b - a), share


def cone(shapes: Shapes, sensor: complex, axis: float, half_angle: float) -> float:
    """Return the distance of the nearest surface point in the beam: of all candidates, the nearest one inside."""
    candidates = []
    edges = [cmath.exp(1j * (axis - half_angle)), cmath.exp(1j * (axis + half_angle))]
    for centre, radius in shapes.circles:
        candidates.append(centre + (sensor - centre) / abs(sensor - centre) * radius)
        for edge in edges:
            candidates += [sensor + t * edge for t in _line_hits_circle(sensor, edge, centre, radius) if t > 0]
    for a, b in shapes.sides:
        foot, share = foot_on_line(sensor, a, b)
        candidates += [a, b] + ([foot] if 0 <= share <= 1 else [])
        for edge in edges:
            along = _line_hits_side(sensor, edge, a, b)
            candidates += [sensor + along * edge] if along is not None and along > 0 else []
    return min(
        (abs(p - sensor) for p in candidates if in_beam(p, sensor, axis, half_angle, 1e-9)),
        default=math.inf,
    )


def surface_samples(shapes: Shapes, spacing: float) -> np.ndarray:
    """Return points on every surface, at most `spacing` apart."""
    pieces = []
    for centre, radius in shapes.circles:
        turn = np.linspace(0, 2 * math.pi, max(8, math.ceil(2 * math.pi * radius / spacing)))
        pieces.append(centre + radius * np.exp(1j * turn))
    for a, b in shapes.sides:
        pieces.append(a + (b - a) * np.linspace(0, 1, max(2, math.ceil(abs(b - a) / spacing))))
    return np.concatenate(pieces) if pieces else np.empty(0, dtype=complex)


def in_sight(shapes: Shapes, sensor: complex, point: complex, slack: float) -> bool:
    """Return whether no surface lies between sensor and point, up to `slack` before the point."""
    reach = abs(point - sensor) - slack
    if reach <= 0:
        return True
    direction = (point - sensor) / abs(point - sensor)
    hits = [t for centre, radius in shapes.circles for t in _line_hits_circle(sensor, direction, centre, radius)]
    hits += [t for a, b in shapes.sides if (t := _line_hits_side(sensor, direction, a, b)) is not None]
    return not any(0 < t < reach for t in hits)


def _opening_towards(vertex: complex, sensor: complex, sides: list[tuple[complex, complex]]) -> float:
    """Return the angle between the surfaces at `vertex` that face the sensor; 2π with a single surface."""
    turns = []
    for a, b in sides:
        share = min(1.0, max(0.0, foot_on_line(vertex, a, b)[1]))
        if abs(a + share * (b - a) - vertex) < 1e-4:
            ends = [end for end in (a, b) if abs(end - vertex) > 1e-4]
            turns += [cmath.phase((end - vertex) / (sensor - vertex)) % (2 * math.pi) for end in ends]
    return min(turns) + (2 * math.pi - max(turns))


def specular(
    shapes: Shapes, sensor: complex, axis: float, half_angle: float, edge_reach: float, slack: float
) -> float:
    """Return the range of the first mirror echo: of all points that may answer, the nearest one in beam and sight."""
    candidates = [c + (sensor - c) / abs(sensor - c) * radius for c, radius in shapes.circles]
    for a, b in shapes.sides:
        foot, share = foot_on_line(sensor, a, b)
        candidates += [foot] if 0 <= share <= 1 else []
    vertices = [end for side in shapes.sides for end in side]
    for i, (a, b) in enumerate(shapes.sides):
        for c, d in shapes.sides[:i]:
            along = _line_hits_side(a, b - a, c, d)
            vertices += [a + along * (b - a)] if along is not None and 0 <= along <= 1 else []
    for vertex in vertices:
        opening = _opening_towards(vertex, sensor, shapes.sides)
        if abs(opening - math.pi) > 1e-3 and (opening < math.pi or abs(vertex - sensor) <= edge_reach):
            candidates.append(vertex)
    return min(
        (
            abs(p - sensor)
            for p in candidates
            if in_beam(p, sensor, axis, half_angle) and in_sight(shapes, sensor, p, slack)
        ),
        default=math.inf,
    )
