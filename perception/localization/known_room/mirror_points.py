"""The mirror points that a sensor in a known room should hear, in its beam and a little beside it."""

from __future__ import annotations

import math

from perception.bayes.memory.polygon_parameters import EDGE_REACH_M
from perception.kernel import kernel
from perception.localization.known_room.surroundings import Corner, Expected, Surroundings, is_surface_hidden

Mirrors = tuple[Expected, Expected]
"""Of the nearest mirror point in the beam, and of a nearer one beside it."""


Found = tuple[float, float, float, float, float, float]
"""Distance and place (m) about the sensor of the nearest point in the beam, then of the nearest beside it."""


@kernel
def is_skipped(distance: float, is_inside: bool, is_outside: bool, found: Found) -> bool:
    """Return whether a point is too far beside the beam, or no nearer (m) than what was found in it, or beside it."""
    return is_outside or distance >= (found[0] if is_inside else min(found[0], found[3]))


@kernel
def with_point(
    s: Surroundings, x: float, y: float, px: float, py: float, distance: float, is_inside: bool, found: Found
) -> Found:
    """Return what was found, with a nearer point at (px, py) from a sensor at (x, y), unless a surface hides that."""
    if is_surface_hidden(s, x, y, px, py):
        return found
    best, best_x, best_y, beside, beside_x, beside_y = found
    if is_inside:
        return distance, px, py, beside, beside_x, beside_y
    return best, best_x, best_y, distance, px, py


@kernel
def faces(corner: Corner, px: float, py: float, distance: float) -> bool:
    """Return whether a corner at (px, py) from a sensor, so far away (m), answers it: an edge from near alone."""
    if corner.opening >= math.pi and distance > EDGE_REACH_M:
        return False
    return (math.atan2(-py, -px) - corner.start) % (2.0 * math.pi) < corner.opening


@kernel
def expect_specular(s: Surroundings, x: float, y: float, cos: float, sin: float, cos_fringe: float) -> Mirrors:
    """Return the distances (m) of the nearest visible mirror point in a beam, and of one beside it that is nearer.

    Arguments as of `expect_cone`. Points within the angle of `cos_fringe`, but not in the beam, are beside it; with
    the beam's own cosine none is.
    """
    near, cos_half = s.near[0], s.sensor[0].cos_half
    off = math.hypot(x - near.x, y - near.y)
    found = (math.inf, 0.0, 0.0, math.inf, 0.0, 0.0)
    for k in range(near.wall_count):
        if near.wall_m[k] - off > found[0]:
            break
        wall = s.walls[near.walls[k]]
        height = wall.offset - wall.nx * x - wall.ny * y
        px, py, distance = height * wall.nx, height * wall.ny, abs(height)
        ahead = px * cos + py * sin
        is_inside = ahead >= distance * cos_half
        if is_skipped(distance, is_inside, ahead < distance * cos_fringe, found):
            continue
        ax, ay, bx, by = wall.x1 - x - px, wall.y1 - y - py, wall.x2 - x - px, wall.y2 - y - py
        if ax * bx + ay * by <= 0.0:
            found = with_point(s, x, y, px, py, distance, is_inside, found)
    for k in range(near.corner_count):
        if near.corner_m[k] - off > found[0]:
            break
        corner = s.corners[near.corners[k]]
        px, py = corner.x - x, corner.y - y
        distance = math.hypot(px, py)
        ahead = px * cos + py * sin
        is_inside = ahead >= distance * cos_half
        if is_skipped(distance, is_inside, ahead < distance * cos_fringe, found):
            continue
        if faces(corner, px, py, distance):
            found = with_point(s, x, y, px, py, distance, is_inside, found)
    for k in range(near.circle_count):
        if near.circle_m[k] - off > found[0]:
            break
        circle = s.circles[near.circles[k]]
        cx, cy = circle.x - x, circle.y - y
        centre = math.hypot(cx, cy)
        gap, ahead = centre - circle.radius, cx * cos + cy * sin
        is_inside = ahead >= centre * cos_half
        if gap <= 0.0 or is_skipped(gap, is_inside, ahead < centre * cos_fringe, found):
            continue
        px, py = cx * gap / centre, cy * gap / centre
        found = with_point(s, x, y, px, py, gap, is_inside, found)
    best, best_x, best_y, beside, beside_x, beside_y = found
    if beside >= best:
        beside = math.inf
    return mirror(best, best_x, best_y), mirror(beside, beside_x, beside_y)


@kernel
def mirror(distance: float, x: float, y: float) -> Expected:
    """Return the distance (m) of a mirror point, and its derivative by the sensor's place; it is at (x, y)."""
    if distance == math.inf or distance <= 0.0:
        return distance, 0.0, 0.0
    return distance, -x / distance, -y / distance
