"""Corners of a room: where two walls would meet, and whether the point itself answers.

Two smooth walls that meet reflect sound back to where it came from, so an inside corner is heard from far around. Its
echoes prove that both walls reach it.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.state import StateRecord
from perception.bayes.wall_contact import is_on_span, wall_normal
from perception.bayes.wall_records import CORNERS_MAX, MAX_WALLS, Wall
from perception.kernel import kernel

CORNER_REACH_M: Final = 2.0
"""Farthest that a corner may lie beyond the ends of its walls …"""
CORNER_INSIDE_M: Final = 0.2
"""… and inside them."""
CORNER_SINE_MIN: Final = 0.4
"""Least sine of the angle between the walls."""
SAME_CORNER_M: Final = 0.2
CORNER_ECHOES_MIN: Final = 3.0
"""Echoes of a sure corner, which must also outnumber its passes."""
KEPT: Final = 1
PENDING: Final = 2
"""Values of `RoomCorner.is_used` while corners are found again: found, and not yet found."""


@kernel
def crossing(a: Wall, b: Wall) -> tuple[bool, float, float]:
    """Return whether two walls would meet near their ends, and where their lines cross, m.

    Parameters
    ----------
    a, b : Wall
        The walls.
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
    along_a = a.normal_x * (y - a.origin_y) - a.normal_y * (x - a.origin_x)
    along_b = b.normal_x * (y - b.origin_y) - b.normal_y * (x - b.origin_x)
    is_near = is_on_span(a, along_a, CORNER_REACH_M) and is_on_span(b, along_b, CORNER_REACH_M)
    is_within = is_on_span(a, along_a, -CORNER_INSIDE_M) or is_on_span(b, along_b, -CORNER_INSIDE_M)
    return is_near and not is_within, x, y


@kernel
def find_corners(s: StateRecord) -> None:
    """Find the corners again: those of the present walls, with the echoes that they had; too many are left out."""
    room = s[0].room
    for c in range(CORNERS_MAX):
        if room.corners[c].is_used == KEPT:
            room.corners[c].is_used = PENDING
    for j in range(MAX_WALLS):
        for k in range(j):
            if room.walls[j].weight <= 0.0 or room.walls[k].weight <= 0.0:
                continue
            is_corner, x, y = crossing(room.walls[k], room.walls[j])
            if not is_corner:
                continue
            at = -1
            for c in range(CORNERS_MAX):
                corner = room.corners[c]
                if corner.is_used == 0:
                    at = c if at < 0 else at
                elif math.hypot(corner.x - x, corner.y - y) < SAME_CORNER_M:
                    at = c
                    break
            if at < 0:
                continue
            corner = room.corners[at]
            if corner.is_used == 0:
                corner.echoes = 0.0
                corner.passes = 0.0
                corner.ended = 0.0
            corner.is_used = KEPT
            corner.x = x
            corner.y = y
            corner.first = k
            corner.second = j
    for c in range(CORNERS_MAX):
        if room.corners[c].is_used == PENDING:
            room.corners[c].is_used = 0
