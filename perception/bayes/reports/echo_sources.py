"""Where in its beam an echo came from, if an object, a wall or a corner that is sure explains it: for the grid."""

from __future__ import annotations

import math

from perception.bayes.memory.elements import Reading
from perception.bayes.memory.scratch import POLYGON
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import CircleTracks, PolygonTrack, StateRecord
from perception.bayes.memory.wall_records import CORNERS_MAX, RoomCorner
from perception.bayes.walls.contact import (
    FOOT,
    are_mirrors,
    contact,
    edge_direction,
    edges_answer,
    explaining_wall,
    is_on_straight_span,
    wall_normal,
)
from perception.bayes.walls.corners import CORNER_ECHOES_MIN, point_of
from perception.kernel import Floats, kernel
from perception.shared_numbers import FAR


@kernel
def bearing_of(q: Reading, dx: float, dy: float, p: SettingsRecord) -> float:
    """Return the angle of a direction off a reading's axis, rad; at most half the beam's width."""
    off = math.atan2(q.axis_x * dy - q.axis_y * dx, q.axis_x * dx + q.axis_y * dy)
    half = math.acos(p[0].cos_half_angle)
    return min(half, max(-half, off))


@kernel
def bearing_of_polygon(q: Reading, track: PolygonTrack, p: SettingsRecord) -> float:
    """Return the bearing of the point of a polygon whose distance fits a reading best, among each side's nearest."""
    outline = p[0].polygons[track.model]
    c = math.cos(track.heading)
    s = math.sin(track.heading)
    least = math.inf
    found = math.nan
    for k in range(outline.side_count):
        side = outline.sides[k]
        tx = c * side.tangent_x - s * side.tangent_y
        ty = s * side.tangent_x + c * side.tangent_y
        dx = track.x + c * side.x - s * side.y - q.x
        dy = track.y + s * side.x + c * side.y - q.y
        along = min(side.length, max(0.0, -(dx * tx + dy * ty)))
        dx += along * tx
        dy += along * ty
        d = math.hypot(dx, dy)
        error = abs(d - q.range_m)
        if error < least and dx * q.axis_x + dy * q.axis_y >= p[0].cos_may_answer * d:
            least = error
            found = bearing_of(q, dx, dy, p)
    return found


@kernel
def is_sure_corner(corner: RoomCorner) -> bool:
    """Return whether a corner was heard more often than ranges passed it, and often enough to be sure of it."""
    return bool(corner.echoes >= CORNER_ECHOES_MIN and corner.echoes > corner.passes)


@kernel
def locate_echoes(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, m: int, sure: float, out: Floats) -> int:
    """Write the bearing of each fired reading's contact, NaN where nothing that is sure explains it.

    Return −1 if slanting walls are known not to answer, 1 if they do, 0 if it is not known.

    Parameters
    ----------
    s, tracks, p
        Memory, circles and settings.
    m : int
        Readings of this firing.
    sure : float
        A circle is sure from this probability on, or once it is named.
    out : (n,) float
        By sensor, rad from its axis, counter-clockwise. Those of sensors that heard the same as before, from the same
        place, stay as they are.
    """
    room = s[0].room
    for i in range(m):
        q = s[0].scratch.fired[i]
        of = s[0].scratch.explained_by[i]
        bearing = math.nan
        if q.range_m < FAR:
            if of >= POLYGON:
                bearing = bearing_of_polygon(q, s[0].polygons[of - POLYGON], p)
            elif of >= 0 and (tracks[of].is_named == 1 or tracks[of].probability >= sure):
                bearing = bearing_of(q, tracks[of].x - q.x, tracks[of].y - q.y, p)
            else:
                own, kind, _ = explaining_wall(room, q, p, 0.0)
                if own >= 0 and is_on_straight_span(room.walls[own], contact(room.walls[own], q, p)[2]):
                    nx, ny = wall_normal(room.walls[own])
                    if kind != FOOT:
                        nx, ny = edge_direction(q, nx, ny, p)
                    bearing = bearing_of(q, nx, ny, p)
                else:
                    c, _ = point_of(room, room.corners, CORNERS_MAX, q, p)
                    if c >= 0 and is_sure_corner(room.corners[c]):
                        bearing = bearing_of(q, room.corners[c].x - q.x, room.corners[c].y - q.y, p)
        out[s[0].scratch.fired_sensors[i]] = bearing
    return 1 if edges_answer(room) else -1 if are_mirrors(room) else 0
