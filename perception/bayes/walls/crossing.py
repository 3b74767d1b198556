"""Where two walls would meet, and whether that is an inside corner or an edge.

Each wall is known as seen from one side, so a corner has a left wall and a right one. Two walls that lie the same way
from their crossing are heard from different sides, and have no corner in common.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.memory.wall_records import Wall
from perception.bayes.walls.contact import is_on_span, wall_normal
from perception.kernel import kernel

CORNER_BEYOND_M: Final = 2.0
"""Farthest that a corner may lie beyond the ends of its walls."""
CORNER_INSIDE_M: Final = 0.4
"""Farthest that a corner may lie inside the ends of its walls."""
CORNER_SINE_MIN: Final = 0.4
"""Least sine of the angle between the walls."""


@kernel
def position_along(wall: Wall, x: float, y: float) -> float:
    """Return the position of a point along a wall's frame, m."""
    return wall.normal_x * (y - wall.origin_y) - wall.normal_y * (x - wall.origin_x)


@kernel
def way_from(wall: Wall, along: float) -> float:
    """Return which way a wall goes from a position along it, 1 or −1: that of the span that ends nearest to it."""
    way = 1.0
    nearest = math.inf
    for k in range(wall.span_count):
        span = wall.spans[k]
        low = abs(span.low - along)
        high = abs(span.high - along)
        if min(low, high) < nearest:
            nearest = min(low, high)
            way = 1.0 if low < high else -1.0
    return way


@kernel
def crossing(a: Wall, b: Wall) -> tuple[bool, float, float]:
    """Return whether two walls would meet near their ends, and where their lines cross, m.

    Seen from where both are heard, one wall ends at the left of a corner and the other one begins at its right.
    """
    ax, ay = wall_normal(a)
    bx, by = wall_normal(b)
    det = ax * by - ay * bx
    if not abs(det) >= CORNER_SINE_MIN:
        return False, 0.0, 0.0
    level_a = ax * (a.origin_x + a.normal_x * a.offset) + ay * (a.origin_y + a.normal_y * a.offset)
    level_b = bx * (b.origin_x + b.normal_x * b.offset) + by * (b.origin_y + b.normal_y * b.offset)
    x = (level_a * by - level_b * ay) / det
    y = (ax * level_b - bx * level_a) / det
    along_a = position_along(a, x, y)
    along_b = position_along(b, x, y)
    is_near = is_on_span(a, along_a, CORNER_BEYOND_M) and is_on_span(b, along_b, CORNER_BEYOND_M)
    is_within = is_on_span(a, along_a, -CORNER_INSIDE_M) or is_on_span(b, along_b, -CORNER_INSIDE_M)
    # Where both go the same way, one of them is seen from behind the other: they are not sides of one corner.
    has_two_sides = is_near and way_from(a, along_a) != way_from(b, along_b)
    return has_two_sides and not is_within, x, y


@kernel
def is_edge(a: Wall, b: Wall, x: float, y: float) -> bool:
    """Return whether the corner of two walls is an edge that juts out: one of them leaves it behind the other."""
    way = way_from(a, position_along(a, x, y))
    nx, ny = wall_normal(b)
    return bool(way * (nx * -a.normal_y + ny * a.normal_x) > 0.0)
