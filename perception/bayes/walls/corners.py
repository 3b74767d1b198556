"""Corners of a room: where walls would meet, where they end, and whether the points themselves answer.

Two smooth walls that meet reflect sound back to where it came from, so an inside corner is heard from far around. Its
echoes prove that both walls reach it. The post of a doorway and the edge of a box scatter sound; smooth ones are
heard from near, rough ones from afar, and they say better where a wall ends than the wall's own echoes.

A point's place comes from the lines of its walls and from its own echoes, added as information.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.memory.elements import Reading
from perception.bayes.memory.polygon_parameters import EDGE_REACH_M
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import CircleTracks, StateRecord
from perception.bayes.memory.wall_records import (
    CORNERS_MAX,
    EDGES_MAX,
    MAX_WALLS,
    PointInformation,
    RoomCorner,
    Wall,
    WallMap,
)
from perception.bayes.walls.contact import (
    CORNER_SLACK_M,
    EDGE_SIGMA_M,
    EXPLAINED_SIGMAS,
    FIRM_WEIGHT,
    HEARD_REACH_M,
    are_mirrors,
    distance_and_foot,
    edges_answer,
    is_hidden,
    is_on_span,
    line_variance,
    range_sigma,
    wall_normal,
    wall_point,
)
from perception.bayes.walls.crossing import CORNER_BEYOND_M, crossing, is_edge, position_along
from perception.kernel import kernel
from perception.records import Records

SAME_CORNER_M: Final = 0.2
"""Corners and edges nearer to each other than this are one."""
CORNER_ECHOES_MIN: Final = 3.0
"""Echoes of a sure corner, which must also outnumber its passes."""
EDGE_SAME_M: Final = 0.3
"""A point this near to the end of a span is its own, and one this near to a corner or an edge that is known better
is that one."""
EDGE_OFF_M: Final = 0.1
"""Greatest distance of an edge from its wall's line."""
EDGE_ECHOES_MIN: Final = 4.0
"""Echoes of a sure edge."""
CORNER_SYSTEMATIC_M: Final = 0.002
"""Least uncertainty of a line at a corner."""
PASS_SLACK_M: Final = 0.1
"""A range this much longer than to a point passed it."""
ALONE_LEAD: Final = 2.0
"""So many times its passes have the echoes of a point between mirrors that is sure whatever its walls are."""
KEPT, PENDING = range(1, 3)
"""Values of `RoomCorner.is_used` while points are found again: found, and not yet found."""


@kernel
def add_line(wall: Wall, x: float, y: float, sums: PointInformation) -> None:
    """Add what a wall's line says of a point on it."""
    nx, ny = wall_normal(wall)
    w = 1.0 / (line_variance(wall, position_along(wall, x, y)) + CORNER_SYSTEMATIC_M**2)
    add_information(sums, nx, ny, nx * x + ny * y, w)


@kernel
def add_information(sums: PointInformation, nx: float, ny: float, level: float, w: float) -> None:
    """Add that a point lies at `level` (m) along a unit vector, with information `w` (m⁻²)."""
    sums.xx += w * nx * nx
    sums.xy += w * nx * ny
    sums.yy += w * ny * ny
    sums.x += w * nx * level
    sums.y += w * ny * level


@kernel
def clear_information(sums: PointInformation) -> None:
    """Forget everything about a point."""
    sums.xx = 0.0
    sums.xy = 0.0
    sums.yy = 0.0
    sums.x = 0.0
    sums.y = 0.0


@kernel
def locate(corner: RoomCorner, lines: PointInformation) -> None:
    """Write a corner's place and covariance from its echoes and from its lines, which are cleared."""
    heard = corner.heard
    xx = heard.xx + lines.xx
    xy = heard.xy + lines.xy
    yy = heard.yy + lines.yy
    x = heard.x + lines.x
    y = heard.y + lines.y
    det = xx * yy - xy * xy
    corner.covariance_xx = yy / det
    corner.covariance_xy = -xy / det
    corner.covariance_yy = xx / det
    corner.x = (yy * x - xy * y) / det
    corner.y = (xx * y - xy * x) / det
    clear_information(lines)


@kernel
def clear_corner(corner: RoomCorner) -> None:
    """Forget a corner's echoes."""
    corner.echoes = 0.0
    corner.passes = 0.0
    corner.ended = 0.0
    corner.far_echoes = 0.0
    corner.far_passes = 0.0
    corner.is_kept = 0
    clear_information(corner.heard)


@kernel
def copy_heard(a: RoomCorner, b: RoomCorner) -> None:
    """Write what was heard of one corner to another."""
    b.echoes = a.echoes
    b.passes = a.passes
    b.ended = a.ended
    b.far_echoes = a.far_echoes
    b.far_passes = a.far_passes
    b.heard.xx = a.heard.xx
    b.heard.xy = a.heard.xy
    b.heard.yy = a.heard.yy
    b.heard.x = a.heard.x
    b.heard.y = a.heard.y


@kernel
def corner_at(room: WallMap, x: float, y: float) -> int:
    """Return the corner near a crossing of walls, else a free place, cleared; −1 if there is none."""
    at = -1
    for c in range(CORNERS_MAX):
        corner = room.corners[c]
        if corner.is_used != 0 and math.hypot(corner.x - x, corner.y - y) < SAME_CORNER_M:
            return c
        if corner.is_used == 0 and at < 0:
            at = c
    if at >= 0:
        clear_corner(room.corners[at])
    return at


@kernel
def edge_at(room: WallMap, wall: Wall, end: float, side: int, reach: float) -> int:
    """Return the edge that is an end of a wall's, else a free place, cleared; −1 if there is none.

    Parameters
    ----------
    room, wall
        The edges, and the wall.
    end : float
        Position of the end along the wall, m.
    side : int
        1 for a high end, 0 for a low one.
    reach : float
        Greatest distance beyond the end, m: what lies beyond the wall's next span is another end.
    """
    at, free = -1, -1
    nearest = reach
    for c in range(EDGES_MAX):
        edge = room.edges[c]
        if edge.is_used == 0 and free < 0:
            free = c
        if (edge.is_used != PENDING and edge.is_kept == 0) or edge.second != side:
            continue
        distance, along = distance_and_foot(wall, edge.x, edge.y)
        beyond = along - end if side == 1 else end - along
        farthest = CORNER_BEYOND_M if edge.echoes >= EDGE_ECHOES_MIN else EDGE_SAME_M
        if abs(distance) < EDGE_OFF_M and -EDGE_SAME_M < beyond < farthest and abs(beyond) < nearest:
            nearest = abs(beyond)
            at = c
    if at < 0 and free >= 0:
        clear_corner(room.edges[free])
        at = free
    return at


@kernel
def set_pending(corners: Records[RoomCorner], count: int) -> None:
    """Let corners or edges be found again, but those that were sure when the robot stopped."""
    for c in range(count):
        if corners[c].is_used == KEPT and corners[c].is_kept == 0:
            corners[c].is_used = PENDING


@kernel
def find_corners(s: StateRecord) -> None:
    """Find the corners and edges of the present walls again, with the echoes that they had; too many are left out."""
    room = s[0].room
    lines = room.lines
    set_pending(room.corners, CORNERS_MAX)
    for j in range(MAX_WALLS):
        for k in range(j):
            a, b = room.walls[k], room.walls[j]
            if a.weight <= 0.0 or b.weight <= 0.0:
                continue
            is_corner, x, y = crossing(a, b)
            at = corner_at(room, x, y) if is_corner else -1
            if at < 0 or room.corners[at].is_kept == 1:
                continue
            corner = room.corners[at]
            corner.is_used = KEPT
            corner.is_edge = 1 if is_edge(a, b, x, y) else 0
            corner.first = k
            corner.second = j
            add_line(a, x, y, lines)
            add_line(b, x, y, lines)
            locate(corner, lines)
    for c in range(CORNERS_MAX):
        if room.corners[c].is_used == PENDING:
            room.corners[c].is_used = 0
    find_edges(room)


@kernel
def find_edges(room: WallMap) -> None:
    """Find the edges again: the ends of the walls' spans that no corner is near."""
    set_pending(room.edges, EDGES_MAX)
    for k in range(MAX_WALLS):
        wall = room.walls[k]
        if wall.weight < FIRM_WEIGHT:
            continue
        for e in range(2 * wall.span_count):
            end = wall.spans[e // 2].low if e % 2 == 0 else wall.spans[e // 2].high
            x, y = wall_point(wall, end)
            if is_near_corner(room, k, x, y):
                continue
            reach = CORNER_BEYOND_M
            if e % 2 == 1 and e < 2 * wall.span_count - 1:
                reach = min(reach, wall.spans[e // 2 + 1].low - end)
            elif e % 2 == 0 and e > 0:
                reach = min(reach, end - wall.spans[e // 2 - 1].high)
            at = edge_at(room, wall, end, e % 2, reach)
            if at < 0 or room.edges[at].is_kept == 1:
                continue
            edge = room.edges[at]
            edge.is_used = KEPT
            edge.is_edge = 1
            edge.first = k
            edge.second = e % 2
            if not edges_answer(room) and edge.far_echoes >= EDGE_ECHOES_MIN and edge.far_echoes > edge.far_passes:
                edge.is_edge = 0  # Only another wall's mirror can answer from so far.
            nx, ny = wall_normal(wall)
            add_line(wall, x, y, room.lines)
            add_information(room.lines, -ny, nx, nx * y - ny * x, 1.0 / EDGE_SIGMA_M**2)
            old_x, old_y = edge.x, edge.y
            locate(edge, room.lines)
            # Ranges that went on past another place say nothing of this one: ends move as their walls grow.
            edge.passes *= max(0.0, 1.0 - math.hypot(edge.x - old_x, edge.y - old_y) / EDGE_SIGMA_M)
    for c in range(EDGES_MAX):
        edge = room.edges[c]
        keep_heard(room, edge)
        if edge.is_kept == 0 and (edge.is_used == PENDING or is_near_corner(room, edge.first, edge.x, edge.y)):
            edge.is_used = 0


@kernel
def keep_heard(room: WallMap, edge: RoomCorner) -> None:
    """Keep a point between mirrors at which no wall ends, or none any more, if it is heard on the line of one."""
    near = edge.echoes - edge.far_echoes
    is_corner = edge.is_edge == 0 and edge.far_echoes >= max(EDGE_ECHOES_MIN, edge.far_passes)
    is_heard = is_corner or (edge.is_edge == 1 and near >= EDGE_ECHOES_MIN and near > ALONE_LEAD * edge.passes)
    if edge.is_used != PENDING or not is_heard or edges_answer(room):
        return
    for c in range(EDGES_MAX):
        other = room.edges[c]
        if other.is_used == KEPT and math.hypot(other.x - edge.x, other.y - edge.y) < SAME_CORNER_M:
            return
    for k in range(MAX_WALLS):
        wall = room.walls[k]
        distance, along = distance_and_foot(wall, edge.x, edge.y)
        is_beyond = is_on_span(wall, along, HEARD_REACH_M) and not is_on_span(wall, along, 0.0)
        if wall.weight >= FIRM_WEIGHT and abs(distance) < EDGE_OFF_M and is_beyond:
            edge.is_used = KEPT
            edge.first = k
            if is_corner:
                edge.second = int(along > wall.spans[wall.span_count - 1].high)
            add_line(wall, edge.x, edge.y, room.lines)
            locate(edge, room.lines)
            break


@kernel
def is_near_corner(room: WallMap, wall: int, x: float, y: float) -> bool:
    """Return whether a point of a wall is near one of the wall's corners."""
    for c in range(CORNERS_MAX):
        corner = room.corners[c]
        is_own = corner.is_used == KEPT and wall in (corner.first, corner.second)
        if is_own and math.hypot(corner.x - x, corner.y - y) < EDGE_SAME_M:
            return True
    return False


@kernel
def point_of(
    room: WallMap, corners: Records[RoomCorner], count: int, q: Reading, p: SettingsRecord
) -> tuple[int, float]:
    """Return the corner that explains an echo best, and the error as a share of the greatest explained; −1, 1: none.

    Parameters
    ----------
    room, q, p
        The noise, the reading and the settings.
    corners, count
        The corners or the edges, and their number.
    """
    best = -1
    least = 1.0
    are_smooth = are_mirrors(room)
    for c in range(count):
        corner = corners[c]
        if corner.is_used != KEPT:
            continue
        dx = corner.x - q.x
        dy = corner.y - q.y
        d = math.sqrt(dx * dx + dy * dy)
        if dx * q.axis_x + dy * q.axis_y < p[0].cos_half_angle * d or d == 0.0:
            continue
        # Between mirrors an edge is not heard from afar: such echoes are its wall's, which would lack them.
        is_passed = corner.is_edge == 1 and corner.far_passes > max(EDGE_ECHOES_MIN, corner.far_echoes)
        if is_passed and d > EDGE_REACH_M and are_smooth:
            continue
        across = (
            dx * dx * corner.covariance_xx + 2.0 * dx * dy * corner.covariance_xy + dy * dy * corner.covariance_yy
        )
        sigma = math.sqrt(range_sigma(room, d) ** 2 + min(across / (d * d), CORNER_SLACK_M**2))
        error = abs(q.range_m - d) / (EXPLAINED_SIGMAS * sigma)
        if error < least:
            least = error
            best = c
    return best, least


@kernel
def enter_echo(room: WallMap, corner: RoomCorner, q: Reading) -> None:
    """Count an echo for a corner, and add its information, linear in the corner's place."""
    dx = corner.x - q.x
    dy = corner.y - q.y
    d = math.sqrt(dx * dx + dy * dy)
    nx, ny = dx / d, dy / d
    add_information(corner.heard, nx, ny, nx * q.x + ny * q.y + q.range_m, 1.0 / range_sigma(room, q.range_m) ** 2)
    corner.echoes += 1.0
    if d > EDGE_REACH_M:
        corner.far_echoes += 1.0


@kernel
def enter_looks(
    room: WallMap, tracks: CircleTracks, corners: Records[RoomCorner], count: int, q: Reading, p: SettingsRecord
) -> None:
    """Count a reading for or against the corners towards which it looked.

    Parameters
    ----------
    room, tracks, q, p
        The noise, the circles, what lies behind which is not seen, the reading and the settings.
    corners, count
        The corners or the edges, updated, and their number.
    """
    for c in range(count):
        corner = corners[c]
        if corner.is_used != KEPT:
            continue
        dx = corner.x - q.x
        dy = corner.y - q.y
        d = math.sqrt(dx * dx + dy * dy)
        if dx * q.axis_x + dy * q.axis_y < p[0].cos_must_answer * d:
            continue
        # No echo says nothing of what is farther than a sensor hears.
        is_passed = min(q.range_m, p[0].range_max_m) > (
            d + EXPLAINED_SIGMAS * range_sigma(room, d) + PASS_SLACK_M + CORNER_SLACK_M
        )
        if is_passed and is_hidden(tracks, q, corner.x, corner.y):
            continue
        if is_passed and d > EDGE_REACH_M:
            corner.far_passes += 1.0
        if corner.is_edge == 1 and d > EDGE_REACH_M and not edges_answer(room):
            continue
        if is_passed:
            corner.passes += 1.0
        else:
            corner.ended += 1.0
