"""Whether a model is right where it is the best explanation so far, and how much the surroundings ask for.

The alternatives of `perception.bayes.circles.alternatives` are not all there is: a wall that answers from the beam's
edge is none of them, and then the model wins by default. `perception.bayes.circles.outline_check` compares it with
bodies of any outline. The mapped walls and corners must not explain the readings either. And where an echo says
little about the shape, the prior is as much against a model as it is for it elsewhere.

An echo says little where everything echoes, because then it may come from anywhere in the beam; and a short look
says little where names that it gave were withdrawn and no model was confirmed for a while.
"""

from __future__ import annotations

import math

from perception.bayes.inference.cross_path import circle_error, is_crossed, over_line
from perception.bayes.inference.likelihood import level_of, log_likelihood
from perception.bayes.memory.elements import BEARING_BINS, Reading
from perception.bayes.memory.parameters import (
    APART_RADII,
    CONFIRMED_SIDES,
    IN_WALL_NAT,
    READINGS_MEMORY,
    ROOM_MARGIN_M,
    TRUSTED_M,
    WALL_FRONT_RADII,
)
from perception.bayes.memory.polygon_parameters import POLYGON_WALL_LENGTH_RADII
from perception.bayes.memory.settings_record import TABLE_BINS, SettingsRecord
from perception.bayes.memory.state import ESTABLISHED, CircleTrack, CircleTracks, PolygonTrack, StateRecord
from perception.bayes.memory.wall_records import CORNERS_MAX, EDGES_MAX, MAX_WALLS, RoomCorner, WallMap
from perception.bayes.tracks.naming import best_other_lead
from perception.bayes.walls.contact import (
    BEAM_EDGE,
    FOOT,
    NOWHERE,
    contact,
    cuts_circle,
    edges_answer,
    is_on_long_span,
    wall_normal,
)
from perception.bayes.walls.corners import KEPT
from perception.kernel import kernel
from perception.shared_numbers import CERTAIN_PROBABILITY, FAR


@kernel
def count_surroundings(s: StateRecord, m: int, moved_m: float) -> None:
    """Count which of the first `m` fired readings heard nothing, older ones less and less; and the way, m."""
    s[0].unconfirmed_m += moved_m
    for i in range(m):
        s[0].heard *= READINGS_MEMORY
        s[0].silent *= READINGS_MEMORY
        if s[0].scratch.fired[i].range_m >= FAR:
            s[0].silent += 1.0
        else:
            s[0].heard += 1.0


@kernel
def everything_echoes(s: StateRecord, p: SettingsRecord) -> bool:
    """Return whether surfaces answer at any angle here: the beams hear more than mirrors would let them."""
    return s[0].silent < p[0].silent_share_min * (s[0].heard + s[0].silent) or edges_answer(s[0].room)


@kernel
def are_models_few(tracks: CircleTracks, p: SettingsRecord) -> bool:
    """Return whether more of the bodies around the robot are surely something else than are models by name."""
    more = 0
    for t in range(len(tracks)):
        track = tracks[t]
        if track.status == ESTABLISHED:
            if track.kind < p[0].model_count:
                more -= track.is_named
            elif track.probability >= CERTAIN_PROBABILITY:
                more += 1
    return more > 0


@kernel
def is_careful(s: StateRecord, tracks: CircleTracks, p: SettingsRecord) -> bool:
    """Return whether the prior is against a model: an echo says little about the shape, or most bodies are no model.

    Among the legs of chairs and tables one of thirty is a drum. A body heard from one side was named there by 6 nat.
    """
    if everything_echoes(s, p) or are_models_few(tracks, p):
        return True
    return bool(s[0].names_withdrawn > 0 and s[0].unconfirmed_m > TRUSTED_M)


@kernel
def point_evidence(point: RoomCorner, q: Reading, p: SettingsRecord, level: int) -> float:
    """Return the log likelihood ratio (nat) of a range under a corner or an edge; −inf where it lies off the beam."""
    dx = point.x - q.x
    dy = point.y - q.y
    d = math.sqrt(dx * dx + dy * dy)
    if dx * q.axis_x + dy * q.axis_y < p[0].cos_may_answer * d:
        return -math.inf
    e = circle_error(q, dx, dy, d, 0.0)
    if is_crossed(q) and point.is_edge == 0:  # twice the way to the middle between both
        e = q.range_m - math.hypot(dx - 0.5 * q.listener_x, dy - 0.5 * q.listener_y)
    return float(log_likelihood(p, level, e))


@kernel
def wall_evidence(
    room: WallMap, q: Reading, p: SettingsRecord, level: int, edges: bool, margin: float, length_min: float
) -> float:
    """Return the greatest log likelihood ratio (nat) of a range under the mapped walls, off all without one.

    Parameters
    ----------
    room, q, p, level, edges
        As for `room_evidence`.
    margin : float
        So far beyond its ends a span answers, m.
    length_min : float
        Length of the spans that count, at least, m.
    """
    best = float(p[0].table[level, TABLE_BINS - 1])
    for k in range(MAX_WALLS):
        wall = room.walls[k]
        if wall.weight > 0.0:
            kind, expected, along, _ = contact(wall, q, p)
            if is_crossed(q):
                if kind != FOOT:
                    continue
                nx, ny = wall_normal(wall)
                expected, _, _ = over_line(q, nx, ny, expected)
                along += 0.5 * (nx * q.listener_y - ny * q.listener_x)
            if kind != NOWHERE and (kind != BEAM_EDGE or edges) and is_on_long_span(wall, along, margin, length_min):
                best = max(best, log_likelihood(p, level, q.range_m - expected))
    return best


@kernel
def room_evidence(room: WallMap, q: Reading, p: SettingsRecord, level: int, edges: bool) -> float:
    """Return the greatest log likelihood ratio (nat) of a range under the mapped walls, corners and edges.

    Parameters
    ----------
    room, q, p
        Walls and corners, the reading and the settings.
    level : int
        Its noise level.
    edges : bool
        Whether walls answer from the beam's edge.
    """
    best = wall_evidence(room, q, p, level, edges, ROOM_MARGIN_M, 0.0)
    for c in range(CORNERS_MAX):
        if room.corners[c].is_used == 1:
            best = max(best, point_evidence(room.corners[c], q, p, level))
    for c in range(EDGES_MAX):
        if room.edges[c].is_used == KEPT:
            best = max(best, point_evidence(room.edges[c], q, p, level))
    return best


@kernel
def is_on_long_walls(s: StateRecord, p: SettingsRecord, track: PolygonTrack) -> bool:
    """Return whether mapped walls that are longer than a polygon's sides explain the job's readings better than it.

    Parameters
    ----------
    s, p
        Memory and settings.
    track : PolygonTrack
        The track, with its evidence.
    """
    outline, room = p[0].polygons[track.model], s[0].room
    longest = outline.inner_radius_m
    for i in range(outline.side_count):
        longest = max(longest, 0.5 * outline.sides[i].length)
    length_min = POLYGON_WALL_LENGTH_RADII * longest
    edges = edges_answer(room)
    evidence = 0.0
    for j in range(s[0].job.reading_count):
        q = s[0].job_readings[j]
        level = level_of(p, s[0].noise_level, q.range_m)
        if is_crossed(q):
            evidence += float(p[0].table[level, TABLE_BINS - 1])
        else:
            evidence += wall_evidence(room, q, p, level, edges, 0.0, length_min)
    return evidence - track.log_likelihood_ratio > IN_WALL_NAT


@kernel
def check_model(s: StateRecord, p: SettingsRecord, track: CircleTrack, n: int) -> None:
    """Update the lead of the mapped room over a track, and from how many sides it was heard.

    Parameters
    ----------
    s, p
        Memory and settings.
    track : CircleTrack
        Updated.
    n : int
        Its readings, the first of the scratch, and what it predicts of them its `own`.
    """
    scratch, room = s[0].scratch, s[0].room
    sides = scratch.sides
    sides[:] = 0
    edges = edges_answer(room)
    lead = 0.0
    for j in range(n):
        q = scratch.readings[j]
        d, ahead, e = scratch.own.distance[j], scratch.own.ahead[j], scratch.own.error[j]
        if e > p[0].gate_m and ahead >= p[0].cos_must_answer * d and not is_crossed(q):
            lead -= p[0].missed_echo_nat  # where the model had to answer and did not
        if abs(e) > p[0].gate_m or ahead < p[0].cos_half_angle * d:
            continue
        level = level_of(p, s[0].noise_level, q.range_m)
        v = log_likelihood(p, level, e)
        lead += room_evidence(room, q, p, level, edges) - v
        if v > 0.0:
            dx = track.x - q.x
            dy = track.y - q.y
            sides[int((math.atan2(dy, dx) / (2.0 * math.pi) + 0.5) * BEARING_BINS) % BEARING_BINS] = 1
    if cuts_circle(room, track.x, track.y, WALL_FRONT_RADII * track.radius):
        lead = max(lead, 0.0)  # no body stands in a wall, however well it fits
    track.room_lead = lead
    track.sides = 0
    for b in range(BEARING_BINS):
        track.sides += sides[b]


@kernel
def is_named_near(tracks: CircleTracks, x: float, y: float, apart: float) -> bool:
    """Return whether a named circle's centre lies within `apart` of (x, y), m."""
    for t in range(len(tracks)):
        track = tracks[t]
        if track.status == ESTABLISHED and track.is_named == 1 and math.hypot(track.x - x, track.y - y) < apart:
            return True
    return False


@kernel
def count_names(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, t: int, x: float, y: float) -> None:
    """Count the name of a track that was named before its refinement: as confirmed, as withdrawn, or not yet.

    Parameters
    ----------
    s, tracks, p
        Memory and circles, updated, and settings.
    t : int
        The track.
    x, y : float
        Where it was before, m.
    """
    track = tracks[t]
    if track.status == ESTABLISHED and track.is_named == 1:
        if track.sides >= CONFIRMED_SIDES and best_other_lead(track, p) < -p[0].model_prior_nat:
            track.is_confirmed = 1
            s[0].names_withdrawn = 0
            s[0].unconfirmed_m = 0.0
    elif track.is_confirmed == 0 and not is_named_near(tracks, x, y, max(p[0].merge_m, APART_RADII * track.radius)):
        s[0].names_withdrawn += 1
