"""Corners and edges that are heard on the line of a known wall, found among the remembered readings.

Two mirrors that meet answer from their corner at any bearing, often long before the second one is heard at the foot
of a perpendicular. The post of a doorway is heard from near, often before its wall is known, and from where the wall
beyond the doorway is not. Each echo puts the point on a circle, which cuts the line of the known wall in two places;
the point is where many cuts meet. What lies on no wall's line is not looked for: a thin post answers like an edge.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from perception.bayes.memory.polygon_parameters import EDGE_REACH_M
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import Memory, StateRecord
from perception.bayes.memory.wall_records import (
    CORNERS_MAX,
    EDGES_MAX,
    MAX_WALLS,
    REMEMBERED_MAX,
    WALL_BIN_M,
    WALL_BINS,
    RoomCorner,
    Wall,
    WallMap,
)
from perception.bayes.walls.bins import HALF
from perception.bayes.walls.contact import (
    END_MARGIN_M,
    FIRM_WEIGHT,
    FIT_ROUNDS,
    HEARD_REACH_M,
    SAME_SIGMAS,
    are_mirrors,
    distance_and_foot,
    range_sigma,
    wall_normal,
    wall_point,
)
from perception.bayes.walls.corners import (
    ALONE_LEAD,
    EDGE_ECHOES_MIN,
    EDGE_SAME_M,
    KEPT,
    PASS_SLACK_M,
    add_information,
    clear_corner,
    copy_heard,
    find_corners,
)
from perception.kernel import Floats, kernel
from perception.shared_numbers import FAR

ECHOES_MIN: Final = 8
"""Remembered echoes, from afar, that show a corner; `EDGE_ECHOES_MIN` from near show an edge."""
SPREAD_MIN_RAD: Final = 0.2
"""They must come from bearings so far apart: those of another wall lie within half a beam of its normal."""
LONGER_SIGMAS: Final = 1.3
"""An edge's echo is longer than its wall's own by more than this, which one in ten of those is by chance."""
LINE_CELL_M: Final = 0.05
"""Edge of a cell along a wall's line in which echoes of a point are counted."""
EDGE_CUTS_MIN: Final = 2
"""Cuts in one cell for which an edge is looked for there."""
INSIDE_M: Final = 0.25
"""What lies farther than this inside a span is no edge."""
ACROSS_M: Final = 1.15
"""What lies farther than this beyond a span's end, across a doorway, is no edge of it."""
SLANT_MIN: Final = 0.35
"""Least share of the range that runs along the wall: the wall's own echoes have none."""
APART_CELLS: Final = 3
"""Places that are looked at are so many cells apart."""
TRIES_MAX: Final = 4
"""Greatest number of places that are looked at for each kind, the likeliest first."""
FIRST_M: Final = -HALF * WALL_BIN_M - HEARD_REACH_M
LINE_CELLS: Final = int((WALL_BINS * WALL_BIN_M + 2.0 * HEARD_REACH_M) / LINE_CELL_M) + 1
"""Cells along the line of a wall, and where the first one begins, m."""


@kernel
def choose_wall(s: StateRecord, turn: int) -> int:
    """Return the wall on whose line points are looked for; −1 if there is none.

    Parameters
    ----------
    s
        Memory.
    turn : int
        Counts the calls: each looks at the next of the walls whose weight is at least `FIRM_WEIGHT`.
    """
    room = s[0].room
    known = 0
    for k in range(MAX_WALLS):
        known += room.walls[k].weight >= FIRM_WEIGHT
    if known == 0 or not are_mirrors(room):
        return -1
    left = turn % known
    for k in range(MAX_WALLS):
        if room.walls[k].weight >= FIRM_WEIGHT:
            if left == 0 and room.walls[k].span_count > 0:
                return k
            left -= 1
    return -1


@kernel
def count_cuts(s: StateRecord, p: SettingsRecord, k: int, cells: Floats) -> None:
    """Count where the remembered echoes' circles cut a wall's line inside their beams.

    Parameters
    ----------
    s, p
        Memory and settings.
    k : int
        The wall.
    cells : (2, LINE_CELLS) float
        Counts of the cuts of echoes from near, and of those from afar, updated.
    """
    room = s[0].room
    wall = room.walls[k]
    for n in range(min(room.remembered_count, REMEMBERED_MAX)):
        q = room.remembered[n]
        r = q.range_m
        if not r < FAR:
            continue
        distance, foot = distance_and_foot(wall, q.x, q.y)
        half2 = r * r - distance * distance
        if half2 <= (SLANT_MIN * r) ** 2:
            continue
        half = math.sqrt(half2 / (1.0 + wall.slope * wall.slope))
        for sign in (-1.0, 1.0):
            along = foot + sign * half
            x, y = wall_point(wall, along)
            cell = int((along - FIRST_M) / LINE_CELL_M)
            is_ahead = (x - q.x) * q.axis_x + (y - q.y) * q.axis_y >= p[0].cos_half_angle * r
            if is_ahead and 0 <= cell < LINE_CELLS:
                cells[0 if r < EDGE_REACH_M else 1, cell] += 1.0


@kernel
def enter_point_of_line(s: StateRecord, p: SettingsRecord, k: int, along: float, is_near: bool) -> bool:
    """Add a point of a wall's line to the edges, if its remembered echoes show it better than what is known there.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    k, along
        The wall, and the position along it, m.
    is_near : bool
        Whether an edge is looked for, by echoes from near; else a corner, by those from afar.
    """
    room = s[0].room
    wall = room.walls[k]
    free = -1
    for c in range(EDGES_MAX):
        if free < 0 and room.edges[c].is_used == 0:
            free = c
    if free < 0:
        return False
    found = room.edges[free]
    spread = 0.0
    for turn in range(FIT_ROUNDS):
        spread = hear(room, wall, p, along, is_near, LINE_CELL_M if turn == 0 else 0.0, found)
        if turn < FIT_ROUNDS - 1:
            step = step_along(found, wall)
            if math.isnan(step):
                clear_corner(found)
                return False
            along += step
    if is_near:
        is_corner = found.far_echoes >= EDGE_ECHOES_MIN and found.far_echoes > found.far_passes
        is_shown = found.echoes >= EDGE_ECHOES_MIN and found.echoes > ALONE_LEAD * found.passes and not is_corner
        found.far_echoes = 0.0
    else:
        found.echoes = found.far_echoes
        found.passes = found.far_passes
        is_shown = found.echoes >= ECHOES_MIN and found.echoes > ALONE_LEAD * found.passes
    found.ended = found.echoes
    found.is_edge = 1 if is_near else 0
    found.first = k
    found.second = end_of_edge(wall, along) if is_near else int(along > wall.spans[wall.span_count - 1].high)
    if not is_shown or spread < SPREAD_MIN_RAD or not makes_room(room, found, is_near):
        return False
    found.is_used = KEPT
    return True


@kernel
def hear(
    room: WallMap, wall: Wall, p: SettingsRecord, along: float, is_near: bool, slack: float, found: RoomCorner
) -> float:
    """Write to a point what the remembered readings say of a place on a wall's line.

    Parameters
    ----------
    room, wall, p
        The readings, the wall and the settings.
    along, slack : float
        The position along the wall, and its uncertainty, m.
    is_near : bool
        As for `enter_point_of_line`.
    found : RoomCorner
        Gets place, echoes (those from near), passes, and the information of the echoes that are looked for.

    Returns
    -------
    float
        How far apart the bearings of these echoes are, rad.
    """
    x, y = wall_point(wall, along)
    clear_corner(found)
    found.x = x
    found.y = y
    low, high = math.inf, -math.inf
    first_x, first_y = 0.0, 0.0
    for n in range(min(room.remembered_count, REMEMBERED_MAX)):
        q = room.remembered[n]
        dx = x - q.x
        dy = y - q.y
        d2 = dx * dx + dy * dy
        ahead = dx * q.axis_x + dy * q.axis_y
        if ahead <= 0.0 or ahead * ahead < p[0].cos_half_angle ** 2 * d2:
            continue
        d = math.sqrt(d2)
        sigma = range_sigma(room, d)
        error = q.range_m - d
        is_from_near = d <= EDGE_REACH_M
        if abs(error) < SAME_SIGMAS * sigma + slack:
            if is_near and d - abs(distance_and_foot(wall, q.x, q.y)[0]) <= LONGER_SIGMAS * sigma:
                continue
            if is_from_near:
                found.echoes += 1.0
            else:
                found.far_echoes += 1.0
            if is_from_near == is_near:
                nx, ny = dx / d, dy / d
                add_information(found.heard, nx, ny, nx * q.x + ny * q.y + q.range_m, 1.0 / sigma**2)
                if low > high:
                    first_x, first_y = nx, ny
                bearing = math.atan2(first_x * ny - first_y * nx, first_x * nx + first_y * ny)
                low = min(low, bearing)
                high = max(high, bearing)
        # No echo says nothing of what is farther than a sensor hears.
        elif (
            min(error, p[0].range_max_m - d) > SAME_SIGMAS * sigma + PASS_SLACK_M
            and ahead >= p[0].cos_must_answer * d
        ):
            if is_from_near:
                found.passes += 1.0
            else:
                found.far_passes += 1.0
    return max(0.0, high - low)


@kernel
def step_along(found: RoomCorner, wall: Wall) -> float:
    """Return how far along its wall a point's echoes place it from where it is, m; NaN if they do not."""
    nx, ny = wall_normal(wall)
    heard = found.heard
    information = ny * ny * heard.xx - 2.0 * nx * ny * heard.xy + nx * nx * heard.yy
    if not information > 0.0:
        return math.nan
    x = heard.x - heard.xx * found.x - heard.xy * found.y
    y = heard.y - heard.xy * found.x - heard.yy * found.y
    return (nx * y - ny * x) / information


@kernel
def end_of_edge(wall: Wall, along: float) -> int:
    """Return which end of a span a post at `along` (m) marks, as `RoomCorner.second` has it: 1 high, 0 low.

    That is the end nearest to it. But `EDGE_SAME_M` beyond that end or farther, the post is taken for the other side
    of an opening, where a span begins that is not known yet: then it is the opposite end. 0 for a wall without spans.
    """
    nearest = math.inf
    side = 0
    for k in range(2 * wall.span_count):
        end = wall.spans[k // 2].high if k % 2 == 1 else wall.spans[k // 2].low
        beyond = along - end if k % 2 == 1 else end - along
        if abs(beyond) < nearest:
            nearest = abs(beyond)
            side = k % 2 if beyond < EDGE_SAME_M else 1 - k % 2
    return side


@kernel
def makes_room(room: WallMap, found: RoomCorner, is_near: bool) -> bool:
    """Remove the edges near a point that are known by fewer echoes; return whether the point may be added.

    It may not beside an edge that stays; then none is removed. Nor may it where walls meet, but their corner gets its
    echoes if it has fewer: most were heard before both walls were known.

    Parameters
    ----------
    room : WallMap
        Updated.
    found, is_near
        The point, and whether it is an edge heard from near.
    """
    for c in range(CORNERS_MAX):
        corner = room.corners[c]
        if corner.is_used == KEPT and math.hypot(corner.x - found.x, corner.y - found.y) < EDGE_SAME_M:
            if corner.is_edge == found.is_edge and corner.echoes < found.echoes:
                copy_heard(found, corner)
            return False
    for is_decided in (False, True):
        for c in range(EDGES_MAX):
            edge = room.edges[c]
            if edge.is_used != KEPT or math.hypot(edge.x - found.x, edge.y - found.y) >= EDGE_SAME_M:
                continue
            echoes = edge.echoes - edge.far_echoes if is_near else edge.echoes
            if is_decided:
                edge.is_used = 0
            elif echoes >= found.echoes or (is_near and edge.is_edge == 0) or edge.is_kept == 1:
                return False
    return True


def find_heard_points(memory: Memory, p: SettingsRecord, turn: int) -> None:
    """Look for corners and edges on the line of one wall, and add them to the edges.

    Parameters
    ----------
    memory, p
        Updated, and the settings.
    turn : int
        Counts the calls: each looks at the next wall.
    """
    k = choose_wall(memory.s, turn)
    if k < 0:
        return
    cells = np.zeros((2, LINE_CELLS))
    count_cuts(memory.s, p, k, cells)
    wall = memory.state["room"][0]["walls"][k]
    spans = wall["spans"][: int(wall["span_count"])]
    low, high = spans["low"], spans["high"]
    cuts = cells[:, :-1] + cells[:, 1:]  # in places as wide as two cells, which overlap
    at = FIRST_M + LINE_CELL_M * np.arange(1.0, LINE_CELLS)
    beyond = np.maximum(low[0] - at, at - high[-1])
    corners = np.where((beyond > END_MARGIN_M) & (beyond < HEARD_REACH_M), cuts.sum(axis=0), 0.0)
    within = np.minimum(at[:, None] - low, high - at[:, None]).max(axis=1)
    edges = np.where((within < INSIDE_M) & (within > -ACROSS_M), cuts[0], 0.0)
    is_new = False
    for counts, least in ((corners, ECHOES_MIN), (edges, EDGE_CUTS_MIN)):
        for _ in range(TRIES_MAX):
            cell = int(counts.argmax())
            if counts[cell] < least:
                break
            counts[max(0, cell - APART_CELLS) : cell + APART_CELLS + 1] = 0.0
            is_new = enter_point_of_line(memory.s, p, k, float(at[cell]), counts is edges) or is_new
    if is_new:
        find_corners(memory.s)
