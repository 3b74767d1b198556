"""Association of readings with polygons, and division of readings between neighbouring polygons."""

from __future__ import annotations

import math

from perception.bayes.inference.cross_path import is_crossed
from perception.bayes.inference.noise_estimation import noise_variance, tolerance_m
from perception.bayes.inference.reservoir import copy_reading, keep_reading
from perception.bayes.memory.elements import MAX_POLYGONS, Reading
from perception.bayes.memory.polygon_parameters import OVERLAP_RADII, WHOLE_SHARE
from perception.bayes.memory.scratch import POLYGON
from perception.bayes.memory.settings_record import PolygonSide, SettingsRecord
from perception.bayes.memory.state import ESTABLISHED, FREE, CircleTracks, PolygonTrack, StateRecord
from perception.bayes.polygons.cross_path import predict_cross
from perception.bayes.polygons.job import cost
from perception.bayes.polygons.likelihood import predict
from perception.bayes.polygons.readings import bears_on_polygon
from perception.kernel import kernel
from perception.records import Records


@kernel
def range_error(
    q: Reading, track: PolygonTrack, sides: Records[PolygonSide], is_closed: bool, p: SettingsRecord
) -> float:
    """Return a reading's least absolute error against the polygon's mirror and cone predictions, m.

    Parameters
    ----------
    q, track
        The reading and the body.
    sides, is_closed, p
        As for `likelihood.predict`.
    """
    c = math.cos(track.heading)
    sn = math.sin(track.heading)
    if is_crossed(q):
        mirror, _, cone = predict_cross(q, track.x, track.y, c, sn, sides, is_closed, p)
        return min(abs(q.range_m - mirror), abs(q.range_m - cone))
    dx = q.x - track.x
    dy = q.y - track.y
    mirror, _, _, cone, _ = predict(
        c * dx + sn * dy,
        -sn * dx + c * dy,
        c * q.axis_x + sn * q.axis_y,
        -sn * q.axis_x + c * q.axis_y,
        sides,
        is_closed,
        p,
    )
    return min(abs(q.range_m - mirror), abs(q.range_m - cone))


@kernel
def associate_polygons(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, m: int) -> None:
    """Associate fired readings with the established polygons that explain them, and fill the polygons' reservoirs.

    Parameters
    ----------
    s, tracks, p
        Memory, updated, circles and settings.
    m : int
        Echoes; the cross paths follow them.
    """
    var0, _ = noise_variance(s, p)
    tight = tolerance_m(p[0].half_resolution_m, var0)
    for t in range(MAX_POLYGONS):
        track = s[0].polygons[t]
        if track.status == FREE:
            continue
        track.idle_firings += 1
        outline = p[0].polygons[track.model]
        sides = outline.sides[: outline.side_count]
        x = track.x
        y = track.y
        may_explain = track.status == ESTABLISHED and track.hits > WHOLE_SHARE * track.near
        for i in range(m + s[0].scratch.crosses):
            q = s[0].scratch.fired[i]
            if not bears_on_polygon(q, x, y, outline.outer_radius_m, p):
                continue
            owner = s[0].scratch.explained_by[i]
            if 0 <= owner < POLYGON and tracks[owner].kind < p[0].model_count:
                continue
            keep_reading(track, x, y, q)
            track.unseen += 1
            track.idle_firings = 0
            track.final_refinements = p[0].final_refinements
            if may_explain and range_error(q, track, sides, outline.is_closed > 0, p) < tight:
                s[0].scratch.explained_by[i] = POLYGON + t


@kernel
def hides(q: Reading, track: PolygonTrack, inner: float, other: PolygonTrack, other_inner: float) -> bool:
    """Return whether another body stands between a reading's sensor and a track.

    Parameters
    ----------
    q, track, other
        The reading, the track and the other body.
    inner, other_inner : float
        Their inner radii, m.
    """
    dx = track.x - q.x
    dy = track.y - q.y
    ex = other.x - q.x
    ey = other.y - q.y
    d = math.hypot(dx, dy)
    if d == 0.0:
        return False
    ahead = (dx * ex + dy * ey) / d
    across_m = abs(dx * ey - dy * ex) / d
    return 0.0 < ahead < d and bool(across_m < other_inner + 0.5 * inner)


@kernel
def leave_to_next_neighbour(s: StateRecord, p: SettingsRecord, t: int) -> int:
    """Drop the job's readings that the next established neighbour explains better; return the cost.

    Where bodies almost touch, the echoes of one body's corner are outliers to the other and bias its pose; so does
    silence from what the neighbour hides.
    """
    job = s[0].job
    u = job.next_step
    job.next_step += 1
    n = job.reading_count
    own = s[0].polygons[t]
    other = s[0].polygons[u]
    if u == t or other.status != ESTABLISHED:
        return 1
    outline = p[0].polygons[own.model]
    other_outline = p[0].polygons[other.model]
    inner, other_inner = outline.inner_radius_m, other_outline.inner_radius_m
    apart = math.hypot(other.x - own.x, other.y - own.y)
    if apart > outline.outer_radius_m + p[0].gate_m + other_outline.outer_radius_m or apart < OVERLAP_RADII * inner:
        return 1
    var0, _ = noise_variance(s, p)
    tight = tolerance_m(p[0].half_resolution_m, var0)
    sides = outline.sides[: outline.side_count]
    other_sides = other_outline.sides[: other_outline.side_count]
    readings = s[0].job_readings
    kept = 0
    for j in range(n):
        q = readings[j]
        ours = range_error(q, own, sides, outline.is_closed > 0, p)
        theirs = range_error(q, other, other_sides, other_outline.is_closed > 0, p)
        if theirs < tight and theirs < ours:
            continue
        if ours > p[0].gate_m and hides(q, own, inner, other, other_inner):
            continue
        copy_reading(q, readings[kept])
        kept += 1
    job.reading_count = kept
    return cost(n, 1, len(sides) + len(other_sides))
