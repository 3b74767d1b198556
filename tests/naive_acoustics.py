"""Slow, readable oracles for the emulator's acoustics: complex numbers, and every candidate listed.

They share no code with the product, not even the conversion of a world to surfaces.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from config.world import WorldConfig


@dataclass(frozen=True)
class Shapes:
    """The surfaces of a world: circles (centre, radius) and sides (both ends); how each answers, if not all alike."""

    circles: list[tuple[complex, float]]
    sides: list[tuple[complex, complex]]
    circle_answers: list[str] = field(default_factory=list)
    side_answers: list[str] = field(default_factory=list)

    def circle_is(self, model: str) -> list[bool]:
        return [answer == model for answer in self.circle_answers] or [True] * len(self.circles)

    def side_is(self, model: str) -> list[bool]:
        return [answer == model for answer in self.side_answers] or [True] * len(self.sides)


def shapes_of(world: WorldConfig, model: str = "") -> Shapes:
    """Return the surfaces of a world; with the world's model also how each answers."""
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
    answers = [wall.surface or model for wall in world.wall]
    answers += [box.surface or model for box in world.box for _ in range(4)]
    answers += [polygon.surface or model for polygon in world.polygon for _ in polygon.vertices_m]
    drums = [(complex(d.x_m, d.y_m), d.radius_m) for d in world.drum]
    if not model:
        return Shapes(drums, sides)
    return Shapes(drums, sides, [d.surface or model for d in world.drum], answers)


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


def rays(shapes: Shapes, sensor: complex, axis: float, half_angle: float, count: int) -> float:
    """Return the nearest of the first hits of some rays in the beam whose surface answers to rays."""
    found = []
    for turn in np.linspace(-half_angle, half_angle, count).tolist() if count > 1 else [0.0]:
        direction = cmath.exp(1j * (axis + turn))
        hits = [(math.inf, False)]
        for (centre, radius), answers in zip(shapes.circles, shapes.circle_is("rays"), strict=True):
            hits += [(t, answers) for t in _line_hits_circle(sensor, direction, centre, radius) if t > 0]
        for (a, b), answers in zip(shapes.sides, shapes.side_is("rays"), strict=True):
            t = _line_hits_side(sensor, direction, a, b)
            hits += [(t, answers)] if t is not None and t > 0 else []
        nearest, answers = min(hits)
        found.append(nearest if answers else math.inf)
    return min(found)


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


def _opening_towards(
    vertex: complex, sensor: complex, sides: list[tuple[complex, complex]], mirrors: list[bool] | None = None
) -> float:
    """Return the angle between the surfaces at `vertex` that face the sensor; 2π with a single surface.

    π, as of a wall that goes on, if one of these surfaces is no mirror.
    """
    turns, are_mirrors = [], []
    for (a, b), is_mirror in zip(sides, mirrors or [True] * len(sides), strict=True):
        share = min(1.0, max(0.0, foot_on_line(vertex, a, b)[1]))
        if abs(a + share * (b - a) - vertex) < 1e-4:
            ends = [end for end in (a, b) if abs(end - vertex) > 1e-4]
            turns += [cmath.phase((end - vertex) / (sensor - vertex)) % (2 * math.pi) for end in ends]
            are_mirrors += [is_mirror for _ in ends]
    if not (are_mirrors[turns.index(min(turns))] and are_mirrors[turns.index(max(turns))]):
        return math.pi
    return min(turns) + (2 * math.pi - max(turns))


def specular(
    shapes: Shapes, sensor: complex, axis: float, half_angle: float, edge_reach: float, slack: float
) -> float:
    """Return the range of the first mirror echo: of all points that may answer, the nearest one in beam and sight."""
    candidates = [
        c + (sensor - c) / abs(sensor - c) * radius
        for (c, radius), is_mirror in zip(shapes.circles, shapes.circle_is("specular"), strict=True)
        if is_mirror
    ]
    mirrors = shapes.side_is("specular")
    for (a, b), is_mirror in zip(shapes.sides, mirrors, strict=True):
        foot, share = foot_on_line(sensor, a, b)
        candidates += [foot] if 0 <= share <= 1 and is_mirror else []
    vertices = [end for side in shapes.sides for end in side]
    for i, (a, b) in enumerate(shapes.sides):
        for c, d in shapes.sides[:i]:
            along = _line_hits_side(a, b - a, c, d)
            vertices += [a + along * (b - a)] if along is not None and 0 <= along <= 1 else []
    for vertex in vertices:
        opening = _opening_towards(vertex, sensor, shapes.sides, mirrors)
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


# From one sensor over a surface to another: the least way, by searching along each surface.

Ear = tuple[complex, float, float]
"""A sensor: its place, the direction of its axis, and half the width of its beam, rad."""
Curve = Callable[[np.ndarray], np.ndarray]
"""A surface's points for shares of its length from 0 to 1."""
_SAMPLES = 4001


def _way(points: np.ndarray, emitter: complex, listener: complex) -> np.ndarray:
    return np.asarray(abs(points - emitter) + abs(points - listener))


def _golden(function: Callable[[float], float], low: float, high: float) -> float:
    """Return where a function that has one valley is least."""
    ratio = (math.sqrt(5) - 1) / 2
    while high - low > 1e-12:
        left, right = high - ratio * (high - low), low + ratio * (high - low)
        if function(left) < function(right):
            high = right
        else:
            low = left
    return (low + high) / 2


def _bisect(is_allowed: Callable[[float], bool], inside: float, outside: float) -> float:
    for _ in range(60):
        middle = (inside + outside) / 2
        inside, outside = (middle, outside) if is_allowed(middle) else (inside, middle)
    return inside


def _least_on(curve: Curve, allowed: Curve, emitter: complex, listener: complex) -> tuple[complex, float, bool]:
    """Return the allowed point with the shortest way over it, that way, and whether it is a valley of the way."""
    shares = np.linspace(0.0, 1.0, _SAMPLES)
    possible = allowed(curve(shares)).astype(bool)
    best = (complex("nan"), math.inf, False)

    def way(share: float) -> float:
        return float(_way(curve(np.array([share])), emitter, listener)[0])

    def is_allowed(share: float) -> bool:
        return bool(allowed(curve(np.array([share])))[0])

    edges = np.flatnonzero(np.diff(np.concatenate([[False], possible, [False]]).astype(int)))
    for first, last in zip(edges[::2], edges[1::2] - 1, strict=True):
        low = shares[first] if first == 0 else _bisect(is_allowed, shares[first], shares[first - 1])
        high = shares[last] if last == _SAMPLES - 1 else _bisect(is_allowed, shares[last], shares[last + 1])
        share = _golden(way, low, high)
        if way(share) < best[1]:
            is_valley = low + 1e-9 < share < high - 1e-9
            best = (complex(curve(np.array([share]))[0]), way(share), is_valley)
    return best


def _curves(shapes: Shapes, emitter: complex, listener: complex) -> list[tuple[Curve, Curve]]:
    """Return every surface with the test of which of its points both sensors face."""
    curves: list[tuple[Curve, Curve]] = []
    for centre, radius in shapes.circles:

        def circle(share: np.ndarray, centre: complex = centre, radius: float = radius) -> np.ndarray:
            start = cmath.phase(centre - emitter)  # behind, as seen from the emitter
            return np.asarray(centre + radius * np.exp(1j * (start + 2 * math.pi * share)))

        def faces(points: np.ndarray, centre: complex = centre) -> np.ndarray:
            outward = np.conj(points - centre)
            return np.asarray(
                (((emitter - points) * outward).real >= 0) & (((listener - points) * outward).real >= 0)
            )

        curves.append((circle, faces))
    for a, b in shapes.sides:
        same = ((emitter - a) / (b - a)).imag * ((listener - a) / (b - a)).imag > 0

        def side(share: np.ndarray, a: complex = a, b: complex = b) -> np.ndarray:
            return np.asarray(a + share * (b - a))

        def is_same_side(points: np.ndarray, same: bool = same) -> np.ndarray:
            return np.full(points.shape, same)

        curves.append((side, is_same_side))
    return curves


def least_over_circle(radius: float, emitter: complex, listener: complex) -> tuple[complex, float]:
    """Return the reflecting point of a circle round the origin, and the way over it; +inf if it hides one sensor."""
    ((curve, faces),) = _curves(Shapes([(0j, radius)], []), emitter, listener)
    point, way, _ = _least_on(curve, faces, emitter, listener)
    return point, way


def _hears(ear: Ear, points: np.ndarray, margin: float = 0.0) -> np.ndarray:
    return np.asarray(np.abs(np.angle((points - ear[0]) * cmath.exp(-1j * ear[1]))) <= ear[2] + margin)


def _is_free(shapes: Shapes, a: complex, b: complex, slack: float) -> bool:
    """Return whether nothing lies between two points of surfaces."""
    apart = abs(b - a)
    return apart <= 2 * slack or in_sight(shapes, a + slack * (b - a) / apart, b, slack)


def cross_cone(shapes: Shapes, emitter: Ear, listener: Ear, slack: float) -> float:
    """Return half the shortest way over a point in both beams, of all surfaces on which that point is in sight."""
    found = []
    for curve, faces in _curves(shapes, emitter[0], listener[0]):

        def allowed(points: np.ndarray, faces: Curve = faces) -> np.ndarray:
            return np.asarray(faces(points) & _hears(emitter, points) & _hears(listener, points))

        point, way, _ = _least_on(curve, allowed, emitter[0], listener[0])
        if math.isfinite(way) and all(in_sight(shapes, ear[0], point, slack) for ear in (emitter, listener)):
            found.append(way / 2)
    return min(found, default=math.inf)


def _walls_towards(vertex: complex, sensor: complex, sides: list[tuple[complex, complex]]) -> tuple[complex, complex]:
    """Return the directions of the surfaces at `vertex` that face the sensor, on its left and on its right."""
    turns = []
    for a, b in sides:
        share = min(1.0, max(0.0, foot_on_line(vertex, a, b)[1]))
        if abs(a + share * (b - a) - vertex) < 1e-4:
            ends = [end for end in (a, b) if abs(end - vertex) > 1e-4]
            turns += [cmath.phase((end - vertex) / (sensor - vertex)) % (2 * math.pi) for end in ends]
    towards = (sensor - vertex) / abs(sensor - vertex)
    return towards * cmath.exp(1j * min(turns)), towards * cmath.exp(1j * max(turns))


def _least_over_two(
    emitter: complex, listener: complex, vertex: complex, first: complex, second: complex
) -> tuple[float, float, float]:
    """Return the shortest way over a point of each of two walls from a corner, and the points' distances from it."""
    reach = 4 * (abs(emitter - vertex) + abs(listener - vertex))

    def rest(p: complex) -> float:
        from_p, from_l = (p - vertex) / second, (listener - vertex) / second
        weights = abs(from_l.imag), abs(from_p.imag)
        return max(0.0, (from_p.real * weights[0] + from_l.real * weights[1]) / max(sum(weights), 1e-300))

    def way(d: float) -> float:
        p = vertex + d * first
        q = vertex + rest(p) * second
        return abs(p - emitter) + abs(q - p) + abs(q - listener)

    d = _golden(way, 0.0, reach)
    return way(d), d, rest(vertex + d * first)


def cross_specular(shapes: Shapes, emitter: Ear, listener: Ear, edge_reach: float, slack: float) -> float:
    """Return half the shortest way that obeys Fermat: over one surface, over both walls of a corner, over an edge."""
    t, l = emitter[0], listener[0]  # noqa: E741
    found = []

    def add(way: float, out: complex, back: complex) -> None:
        if (
            bool(_hears(emitter, np.array([out]))[0])
            and bool(_hears(listener, np.array([back]))[0])
            and in_sight(shapes, t, out, slack)
            and in_sight(shapes, l, back, slack)
        ):
            found.append(way / 2)

    for curve, faces in _curves(shapes, t, l):
        point, way, is_valley = _least_on(curve, faces, t, l)
        if is_valley:
            add(way, point, point)
    vertices = [end for side in shapes.sides for end in side]
    for i, (a, b) in enumerate(shapes.sides):
        for c, d in shapes.sides[:i]:
            along = _line_hits_side(a, b - a, c, d)
            vertices += [a + along * (b - a)] if along is not None and 0 <= along <= 1 else []
    for vertex in vertices:
        opening = _opening_towards(vertex, t, shapes.sides)
        left, right = _walls_towards(vertex, t, shapes.sides)
        past = cmath.phase((l - vertex) / right) % (2 * math.pi)  # from the clockwise wall, as is the opening
        if abs(opening - math.pi) <= 1e-3 or past >= opening:
            continue
        direct = abs(t - vertex) + abs(l - vertex)
        if opening > math.pi:
            if direct / 2 <= edge_reach:
                add(direct, vertex, vertex)
            continue
        ways = [(*_least_over_two(t, l, vertex, one, two), one, two) for one, two in ((left, right), (right, left))]
        bounces = [way for way in ways if way[1] > 1e-7 and way[2] > 1e-7]
        if not bounces:
            add(direct, vertex, vertex)
        for way, d, e, one, two in bounces:
            p, q = vertex + d * one, vertex + e * two
            on_sides = all(
                any(abs(foot_clipped(point, *side) - point) < slack for side in shapes.sides) for point in (p, q)
            )
            if on_sides and _is_free(shapes, p, q, slack):
                add(way, p, q)
    return min(found, default=math.inf)


def foot_clipped(point: complex, a: complex, b: complex) -> complex:
    """Return the nearest point of a side."""
    return a + min(1.0, max(0.0, foot_on_line(point, a, b)[1])) * (b - a)
