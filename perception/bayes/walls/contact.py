"""Where a reading touches a wall, which range that predicts, and whether a mapped wall or corner explains a reading.

A smooth wall answers from the foot of the perpendicular, where that is inside the beam. A rough one also answers a
slanting beam, from the beam's edge: then the nearest point in the beam lies there. Which of them the walls around are
is counted, so that the edges of beams count only where they answer.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.memory.elements import Reading
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import ESTABLISHED, CircleTracks
from perception.bayes.memory.wall_records import CORNERS_MAX, MAX_WALLS, Wall, WallMap
from perception.kernel import kernel

NOWHERE, FOOT, BEAM_EDGE = range(3)
"""Where an echo comes from."""
EXPLAINED_SIGMAS: Final = 3.2
"""Greatest error of an explained range, in σ of range and wall together."""
SAME_SIGMAS: Final = 2.5
"""Greatest error, in σ, of a range from a candidate's line or a point that it supports, and of a part of the same
wall."""
SLANTING_MIN_COS: Final = 0.25
"""Cosine between axis and normal beyond which nothing is known of a slanting wall's echo."""
SPAN_MARGIN_M: Final = 0.09
"""A wall explains a reading as far as this beyond the ends of its spans: a bin and a half."""
CIRCLE_MARGIN_M: Final = 0.05
"""Distance of a circle's centre outside the beam at which it may still answer."""
END_SLACK_M: Final = 0.05
"""Uncertainty of the place of a wall's end."""
END_MARGIN_M: Final = 0.15
"""What lies nearer than this to the end of a wall is the end itself: corners are farther beyond it, and what shows
how walls answer is farther inside."""
EDGE_SIGMA_M: Final = 0.1
"""Uncertainty of an edge along its wall, before its echoes: after a move by as much it is another place. An edge that
its own echoes place no better than this along some axis was heard from one direction: so the wall answers where it
goes on."""
FIT_ROUNDS: Final = 3
"""Fits of a new wall, or of the place of a point, each with the readings that the one before chooses."""
CORNER_SLACK_M: Final = 0.03
"""Uncertainty of the place of a corner, and the greatest of a point that its echoes may show."""
HIDING_PROBABILITY: Final = 0.9
"""Least probability of a round object without a name that hides what lies behind it, and that explains a wall's
echoes."""
ONLY_NAMED: Final = 2.0
"""A probability that only named circles have."""
WENT_ON_M: Final = 0.05
"""A range longer than to a wall, or to where the beam's edge meets it, by this beyond the error has passed it."""
STRAIGHT_CHI2: Final = 60.0
"""A span of more evidence than this and of `FIRM_WEIGHT` is straight beyond doubt."""
FIRM_WEIGHT: Final = 20.0
"""Weight of a wall from which on its line and its ends are known, and it is reviewed: twenty echoes."""
MIRRORS_SILENCES: Final = 20.0
"""So many silences of beam edges, with so few echoes, show mirrors."""
HEARD_REACH_M: Final = 3.0
"""Farthest beyond the ends of its wall that a corner is looked for among the echoes."""
EDGES_LEAD: Final = 4.0
"""See `EDGES_SHARE`: a lead in echoes, so that the first few decide nothing."""
EDGES_SHARE: Final = 0.25
"""Edges count if their echoes exceed this share of their silences by this lead. Mirrors leave 1 %; of surfaces that
answer at any angle, half: drop-outs, and walls that are not yet known well. Where hardly a beam is silent they count
until their silences lead as far."""


@kernel
def range_sigma(room: WallMap, range_m: float) -> float:
    """Return the standard deviation assumed for a range, m."""
    return math.sqrt(room.variance_m2 + room.relative_variance * range_m * range_m)


@kernel
def edges_answer(room: WallMap) -> bool:
    """Return whether slanting walls answer from the beam's edge here."""
    lead = -EDGES_LEAD if room.is_loud == 1 else EDGES_LEAD
    return bool(room.edge_echoes > EDGES_SHARE * room.edge_silences + lead)


@kernel
def are_mirrors(room: WallMap) -> bool:
    """Return whether the walls here are known to be mirrors: slanting ones do not answer."""
    return bool(room.edge_silences >= MIRRORS_SILENCES and not edges_answer(room))


@kernel
def wall_normal(wall: Wall) -> tuple[float, float]:
    """Return the normal of the fitted line, a unit vector away from the sensors."""
    c = 1.0 / math.sqrt(1.0 + wall.slope * wall.slope)
    return c * (wall.normal_x + wall.slope * wall.normal_y), c * (wall.normal_y - wall.slope * wall.normal_x)


@kernel
def wall_point(wall: Wall, along: float) -> tuple[float, float]:
    """Return the point of the fitted line at a position along it, m."""
    off = wall.offset + wall.slope * along
    return (
        wall.origin_x + wall.normal_x * off - wall.normal_y * along,
        wall.origin_y + wall.normal_y * off + wall.normal_x * along,
    )


@kernel
def distance_and_foot(wall: Wall, x: float, y: float) -> tuple[float, float]:
    """Return a point's distance before a wall, and the position of its foot along the wall, m.

    Parameters
    ----------
    wall : Wall
        The wall.
    x, y : float
        The point, m.
    """
    dx = x - wall.origin_x
    dy = y - wall.origin_y
    across = wall.normal_x * dx + wall.normal_y * dy
    along = wall.normal_x * dy - wall.normal_y * dx
    c2 = 1.0 / (1.0 + wall.slope * wall.slope)
    off = wall.offset + wall.slope * along - across
    return math.sqrt(c2) * off, along - wall.slope * c2 * off


@kernel
def edge_direction(q: Reading, nx: float, ny: float, p: SettingsRecord) -> tuple[float, float]:
    """Return the direction of the beam's edge that is nearer to a normal, a unit vector."""
    sine = p[0].sin_half_angle if q.axis_x * ny - q.axis_y * nx > 0.0 else -p[0].sin_half_angle
    c = p[0].cos_half_angle
    return q.axis_x * c - q.axis_y * sine, q.axis_y * c + q.axis_x * sine


@kernel
def contact(wall: Wall, q: Reading, p: SettingsRecord) -> tuple[int, float, float, float]:
    """Return where a reading would touch a wall without ends, as `touch` does, unless it slants too much."""
    return touch(wall, q, p, SLANTING_MIN_COS)


@kernel
def touch(wall: Wall, q: Reading, p: SettingsRecord, least: float) -> tuple[int, float, float, float]:
    """Return where a reading would touch a wall without ends.

    Parameters
    ----------
    wall, q, p
        The wall, the reading and the settings.
    least : float
        Least cosine between the sensor's axis and the normal.

    Returns
    -------
    (int, float, float, float)
        `FOOT`, `BEAM_EDGE` or `NOWHERE`; the range, m; the position along the wall, m; the cosine between the
        sensor's axis and the normal.
    """
    nx, ny = wall_normal(wall)
    dot = nx * q.axis_x + ny * q.axis_y
    if dot < least:
        return NOWHERE, 0.0, 0.0, dot
    distance, foot = distance_and_foot(wall, q.x, q.y)
    if distance <= 0.0:
        return NOWHERE, 0.0, 0.0, dot
    if dot >= p[0].cos_half_angle:
        return FOOT, distance, foot, dot
    ex, ey = edge_direction(q, nx, ny, p)
    reach = distance / (nx * ex + ny * ey)
    along = wall.normal_x * (q.y + reach * ey - wall.origin_y) - wall.normal_y * (q.x + reach * ex - wall.origin_x)
    return BEAM_EDGE, reach, along, dot


@kernel
def line_variance(wall: Wall, along: float) -> float:
    """Return the variance of a wall's line at a position along it, m²."""
    return wall.variance_offset + 2.0 * along * wall.covariance + along * along * wall.variance_slope


@kernel
def tolerance(room: WallMap, wall: Wall, along: float, range_m: float, dot: float) -> float:
    """Return the greatest error of a range that a wall explains, m.

    Parameters
    ----------
    room, wall
        The noise, and the wall.
    along, range_m : float
        Position along the wall, and the range, m.
    dot : float
        Cosine between the sensor's axis and the wall's normal.
    """
    return EXPLAINED_SIGMAS * math.sqrt(range_sigma(room, range_m) ** 2 + line_variance(wall, along) / dot**2)


@kernel
def is_on_long_span(wall: Wall, along: float, margin: float, length_min: float) -> bool:
    """Return whether a position lies on a span that is so long, m, or at most `margin` (m) beyond its ends."""
    for k in range(wall.span_count):
        span = wall.spans[k]
        if span.low - margin <= along <= span.high + margin and span.high - span.low >= length_min:
            return True
    return False


@kernel
def is_on_span(wall: Wall, along: float, margin: float) -> bool:
    """Return whether a position lies on a span of a wall, or at most `margin` (m) beyond its ends."""
    return is_on_long_span(wall, along, margin, -math.inf)


@kernel
def is_on_straight_span(wall: Wall, along: float) -> bool:
    """Return whether a position lies on a span of a wall that is straight beyond doubt."""
    for k in range(wall.span_count):
        span = wall.spans[k]
        if span.low <= along <= span.high:
            return bool(span.chi2 > STRAIGHT_CHI2 and span.weight > FIRM_WEIGHT)
    return False


@kernel
def cuts_circle(room: WallMap, x: float, y: float, radius: float) -> bool:
    """Return whether a wall that is straight beyond doubt passes through a circle, at least this near to its centre.

    Parameters
    ----------
    room : WallMap
        The walls.
    x, y, radius : float
        The centre, and how near, m.
    """
    for k in range(MAX_WALLS):
        wall = room.walls[k]
        if wall.weight > 0.0:
            distance, along = distance_and_foot(wall, x, y)
            if abs(distance) < radius and is_on_straight_span(wall, along):
                return True
    return False


@kernel
def explaining_wall(room: WallMap, q: Reading, p: SettingsRecord, growth: float) -> tuple[int, int, float]:
    """Return the wall that explains an echo best, where from, and the error as a share of the greatest explained.

    −1, `NOWHERE` and 1 where none does.

    Parameters
    ----------
    room, q, p
        The walls, the reading and the settings.
    growth : float
        If no wall explains it where it has a span, a wall may continue this far beyond, m; half of it where the
        echo comes from the beam's edge. 0: none may.
    """
    best = -1
    best_kind = NOWHERE
    least = 1.0
    beyond = -1
    beyond_kind = NOWHERE
    least_beyond = 1.0
    edges = edges_answer(room)
    for k in range(MAX_WALLS):
        wall = room.walls[k]
        if wall.weight <= 0.0:
            continue
        kind, expected, along, dot = contact(wall, q, p)
        if kind == NOWHERE or (kind == BEAM_EDGE and not edges):
            continue
        error = abs(q.range_m - expected) / tolerance(room, wall, along, expected, dot)
        if error < least and is_on_span(wall, along, SPAN_MARGIN_M):
            least = error
            best = k
            best_kind = kind
        elif error < least_beyond and is_on_span(wall, along, growth if kind == FOOT else 0.5 * growth):
            least_beyond = error
            beyond = k
            beyond_kind = kind
    if best < 0 and growth > 0.0:
        return beyond, beyond_kind, least_beyond
    return best, best_kind, least


@kernel
def is_from_point(room: WallMap, q: Reading, x: float, y: float, slack: float, p: SettingsRecord) -> bool:
    """Return whether an echo may come from a point.

    Parameters
    ----------
    room, q, p
        The noise, the reading and the settings.
    x, y, slack : float
        The point, and the uncertainty of its place, m.
    """
    dx = x - q.x
    dy = y - q.y
    d = math.sqrt(dx * dx + dy * dy)
    if dx * q.axis_x + dy * q.axis_y < p[0].cos_may_answer * d:
        return False
    return abs(q.range_m - d) < EXPLAINED_SIGMAS * range_sigma(room, d) + slack


@kernel
def is_from_circle(room: WallMap, tracks: CircleTracks, q: Reading, p: SettingsRecord, probability: float) -> bool:
    """Return whether a certain circle explains an echo, by its nearest point or where the beam's edge meets it.

    Parameters
    ----------
    room, q, p
        The noise, the echo and the settings.
    tracks : (n,) CircleTrack
        The circles.
    probability : float
        A circle is certain from here on; a named one is at any.
    """
    edges = edges_answer(room)
    for t in range(len(tracks)):
        track = tracks[t]
        if track.status != ESTABLISHED or (track.is_named == 0 and track.probability < probability):
            continue
        dx = track.x - q.x
        dy = track.y - q.y
        d = math.sqrt(dx * dx + dy * dy)
        slack = EXPLAINED_SIGMAS * range_sigma(room, d) + 2.0 * track.root_xx
        e = q.range_m - d + track.radius
        if e < -slack or e > slack + track.radius:
            continue
        if dx * q.axis_x + dy * q.axis_y >= p[0].cos_may_answer * d - CIRCLE_MARGIN_M and e < slack:
            return True
        if edges:
            ex, ey = edge_direction(q, dx, dy, p)
            reach = dx * ex + dy * ey
            half = track.radius**2 - d * d + reach * reach
            if half > -CIRCLE_MARGIN_M * track.radius:
                return abs(q.range_m - reach + math.sqrt(max(half, 0.0))) < slack + CIRCLE_MARGIN_M
    return False


@kernel
def is_hidden(tracks: CircleTracks, q: Reading, x: float, y: float) -> bool:
    """Return whether a round object stands between a sensor and a point, so that no echo can come from there.

    Parameters
    ----------
    tracks : (n,) CircleTrack
        The circles; only certain ones count.
    q : Reading
        The sensor.
    x, y : float
        The point, m.
    """
    dx = x - q.x
    dy = y - q.y
    d2 = dx * dx + dy * dy
    for t in range(len(tracks)):
        track = tracks[t]
        if track.status != ESTABLISHED or (track.is_named == 0 and track.probability < HIDING_PROBABILITY):
            continue
        cx = track.x - q.x
        cy = track.y - q.y
        along = cx * dx + cy * dy
        across = cx * dy - cy * dx
        if 0.0 < along < d2 and across * across < track.radius * track.radius * d2:
            return True
    return False


@kernel
def is_from_end(room: WallMap, wall: Wall, q: Reading, p: SettingsRecord) -> bool:
    """Return whether an echo may come from an end of a wall's spans."""
    for k in range(2 * wall.span_count):
        span = wall.spans[k // 2]
        x, y = wall_point(wall, span.low if k % 2 == 0 else span.high)
        if is_from_point(room, q, x, y, END_SLACK_M, p):
            return True
    return False


@kernel
def corner_of(room: WallMap, q: Reading, p: SettingsRecord) -> int:
    """Return the corner that explains an echo, −1 where none does."""
    for c in range(CORNERS_MAX):
        corner = room.corners[c]
        if corner.is_used == 1 and is_from_point(room, q, corner.x, corner.y, CORNER_SLACK_M, p):
            return c
    return -1
