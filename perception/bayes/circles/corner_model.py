"""Corner of a box: two faces and the edge where they meet, the shape most similar to a drum.

Over a corner a box answers from one face, then from its edge, then from the other face; together the ranges bend like
those of an arc. Only a fit of faces and edge distinguishes the two, so a drum must exceed this explanation too.
"""

from __future__ import annotations

import math

from perception.bayes.circles.alternatives import HOPELESS_NAT, bearing_if_near
from perception.bayes.inference.beam import GRAZING_MIN, ray_over_line
from perception.bayes.inference.cross_path import circle_error, is_crossed, over_line
from perception.bayes.inference.likelihood import level_of, log_likelihood
from perception.bayes.inference.range_fit import Circle, Near, NoiseVariance, fit_reading_line
from perception.bayes.inference.reservoir import copy_reading
from perception.bayes.memory.elements import Reading
from perception.bayes.memory.parameters import (
    CORNER_EDGE_LEAD_GATES,
    CORNER_FACE_READINGS_MIN,
    CORNER_HIT_NAT,
    CORNER_LEEWAY_COS,
    CORNER_MODEL_NAT,
    CORNER_OPENING_MIN,
    CORNER_OUT_OF_BEAM_GATES,
    CORNER_READINGS_MIN,
    CORNER_ROUNDS,
    FIT_SOFTNESS,
)
from perception.bayes.memory.scratch import CornerFit, LineFit, Predictions
from perception.bayes.memory.settings_record import TABLE_BINS, SettingsRecord
from perception.bayes.memory.state import StateRecord
from perception.kernel import Ints, kernel
from perception.records import Records


@kernel
def face_error(q: Reading, cx: float, cy: float, face: LineFit) -> float:
    """Return the range of a reading less its perpendicular distance to a face, or a cross path's half over it, m.

    Parameters
    ----------
    q : Reading
        The reading.
    cx, cy : float
        Origin of the face's line, m.
    face : LineFit
        Unit normal and distance of the face from the origin.
    """
    if face.rays == 0 and not is_crossed(q):
        return q.range_m - face.distance + face.normal_x * (q.x - cx) + face.normal_y * (q.y - cy)
    away = face.distance - face.normal_x * (q.x - cx) - face.normal_y * (q.y - cy)
    if is_crossed(q):
        half, _, _ = over_line(q, face.normal_x, face.normal_y, away)
    else:
        half, _ = ray_over_line(q, face.normal_x, face.normal_y, away, face.half_angle, face.rays)
    return q.range_m - half


@kernel
def is_of_face(
    q: Reading, cx: float, cy: float, corner: CornerFit, side: int, has_edge: bool, cos_may: float, gate: float
) -> bool:
    """Return whether a face explains a reading: better than the other face, and hardly worse than the edge.

    Parameters
    ----------
    q : Reading
        The reading.
    cx, cy : float
        Origin of the faces, m.
    corner, side, has_edge
        The faces, which of them, and whether they meet.
    cos_may, gate : float
        As in `Settings`.
    """
    first = corner.faces[0]
    second = corner.faces[1]
    e0 = abs(face_error(q, cx, cy, first))
    e1 = abs(face_error(q, cx, cy, second))
    if first.normal_x * q.axis_x + first.normal_y * q.axis_y < cos_may:
        e0 += CORNER_OUT_OF_BEAM_GATES * gate
    if second.normal_x * q.axis_x + second.normal_y * q.axis_y < cos_may:
        e1 += CORNER_OUT_OF_BEAM_GATES * gate
    if (e0 <= e1) != (side == 0):
        return False
    if not has_edge or first.rays > 0:
        return True
    ex = corner.edge_x - q.x
    ey = corner.edge_y - q.y
    at_edge = abs(circle_error(q, ex, ey, math.hypot(ex, ey), 0.0))
    return bool(min(e0, e1) <= at_edge + CORNER_EDGE_LEAD_GATES * gate)


@kernel
def find_edge(cx: float, cy: float, corner: CornerFit) -> bool:
    """Write the point where two faces meet; return False where the faces are too nearly parallel.

    Parameters
    ----------
    cx, cy : float
        Origin of the faces' lines, m.
    corner : CornerFit
        The faces; their edge is written.
    """
    a = corner.faces[0]
    b = corner.faces[1]
    det = a.normal_x * b.normal_y - a.normal_y * b.normal_x
    if abs(det) <= CORNER_OPENING_MIN:
        return False
    corner.edge_x = cx + (a.distance * b.normal_y - b.distance * a.normal_y) / det
    corner.edge_y = cy + (a.normal_x * b.distance - b.normal_x * a.distance) / det
    return True


@kernel
def find_facing(
    readings: Records[Reading], predicted: Predictions, cx: float, cy: float, gate: float, facing: Ints
) -> tuple[int, float, float]:  # fmt: skip
    """Write the places of the readings that end near a circle; return their number and the sum of their bearings.

    Parameters
    ----------
    readings, predicted, cx, cy, gate
        As for `alternatives.mean_bearing`.
    facing : (≥ n,) int
        Out.
    """
    count = 0
    sx = 0.0
    sy = 0.0
    for j in range(len(readings)):
        ux, uy = bearing_if_near(readings[j], j, predicted, cx, cy, gate)
        if ux != 0.0 or uy != 0.0:
            sx += ux
            sy += uy
            facing[count] = j
            count += 1
    return count, sx, sy


@kernel
def fit_faces(
    readings: Records[Reading],
    facing: Ints,
    bearing: tuple[float, float],
    face_readings: Records[Reading],
    circle: Circle,
    near: Near,
    noise: NoiseVariance,
    fit: LineFit,
    corner: CornerFit,
) -> tuple[bool, bool]:
    """Fit two faces and their edge, at first to the readings left and right of the mean bearing.

    Parameters
    ----------
    readings, circle, noise
        As for `range_fit.fit_circle`.
    facing, bearing
        From `find_facing`.
    near : Near
        Which readings take part.
    face_readings, fit
        Scratch.
    corner : CornerFit
        Out: both faces about the centre, and their edge, if they have one.

    Returns
    -------
    (bool, bool)
        Whether there are two faces, and whether they have an edge.
    """
    sx, sy = bearing
    cx, cy, radius = circle
    cos_may, gate = near
    has_edge = False
    for turn in range(CORNER_ROUNDS):
        for side in range(2):
            k = 0
            ax = 0.0
            ay = 0.0
            for i in range(len(facing)):
                q = readings[facing[i]]
                dx = cx - q.x
                dy = cy - q.y
                if turn == 0:
                    is_own = (sx * dy - sy * dx > 0.0) == (side == 0)
                else:
                    is_own = is_of_face(q, cx, cy, corner, side, has_edge, cos_may, gate)
                if is_own:
                    copy_reading(q, face_readings[k])
                    d = math.sqrt(dx * dx + dy * dy)
                    ax += dx / d
                    ay += dy / d
                    k += 1
            face = corner.faces[side]
            if turn == 0:
                length = math.hypot(ax, ay)
                if k < CORNER_FACE_READINGS_MIN or length == 0.0:
                    return False, False
                face.normal_x = ax / length
                face.normal_y = ay / length
                face.distance = -radius
            if k >= CORNER_FACE_READINGS_MIN:
                fit_reading_line(
                    face_readings[:k],
                    (face.normal_x, face.normal_y, face.distance),
                    (cx, cy),
                    (cos_may - CORNER_LEEWAY_COS, gate),
                    FIT_SOFTNESS,
                    noise,
                    CORNER_ROUNDS,
                    fit,
                )
                face.normal_x = fit.normal_x
                face.normal_y = fit.normal_y
                face.distance = fit.distance
        has_edge = find_edge(cx, cy, corner)
    return True, has_edge


@kernel
def foot_from_edge(q: Reading, corner: CornerFit, side: int) -> float:
    """Return how far along a face's line from the edge the foot of a sensor's perpendicular lies, m."""
    face = corner.faces[side]
    return face.normal_x * (q.y - corner.edge_y) - face.normal_y * (q.x - corner.edge_x)


@kernel
def way_of_face(
    readings: Records[Reading], facing: Ints, cx: float, cy: float, corner: CornerFit, side: int, cos_may: float
) -> float:
    """Return on which side of the edge a face lies along its line, 1 or −1: where most of its echoes have their feet.

    Parameters
    ----------
    readings, facing, cx, cy
        As for `fit_faces`; the circle's centre, m.
    corner, side, cos_may
        As for `is_of_face`.
    """
    face, other = corner.faces[side], corner.faces[1 - side]
    more = 0
    for i in range(len(facing)):
        q = readings[facing[i]]
        if face.normal_x * q.axis_x + face.normal_y * q.axis_y < cos_may:
            continue
        if abs(face_error(q, cx, cy, face)) <= abs(face_error(q, cx, cy, other)):
            more += 1 if foot_from_edge(q, corner, side) > 0.0 else -1
    return 1.0 if more > 0 else -1.0


@kernel
def score_corner(
    s: StateRecord, p: SettingsRecord, n: int, cx: float, cy: float, radius: float, var0: float, rel2: float
) -> float:
    """Return the log ratio (nat) of a corner fitted to a circle's near readings.

    Each reading counts by the surface that explains it best. A face ends at the edge: with faces that go on behind it
    three surfaces explained each reading, and drums heard over 60° lost to corners by 40 nat. Silence is not evidence
    against it, because a face may end anywhere. A corner is more flexible than a circle, so each hit has a price, and
    so has the model.

    Parameters
    ----------
    s, p
        Memory, of which the first `n` readings of the scratch count, `own` holds what the circle predicts, and
        `corner_fit` is written; and settings.
    n : int
        Readings.
    cx, cy, radius : float
        The circle, m.
    var0, rel2 : float
        Variance of a range r: var0 (m²) + rel2 · r².

    Returns
    -------
    float
        Log ratio to the background, nat, less the price; `HOPELESS_NAT` where there are not two faces.
    """
    scratch = s[0].scratch
    readings = scratch.readings[:n]
    corner = scratch.corner_fit
    cos_may, gate = p[0].cos_may_answer, p[0].gate_m
    if corner.faces[0].rays > 0:
        cos_may = GRAZING_MIN  # a ray meets a face at any angle
    count, sx, sy = find_facing(readings, scratch.own, cx, cy, gate, scratch.facing)
    if count < CORNER_READINGS_MIN:
        return HOPELESS_NAT
    facing = scratch.facing[:count]
    found, has_edge = fit_faces(
        readings,
        facing,
        (sx, sy),
        scratch.face_readings,
        (cx, cy, radius),
        (cos_may, gate),
        (var0, rel2),
        scratch.line_fit,
        corner,
    )
    if not found:
        return HOPELESS_NAT
    total = 0.0
    ends = has_edge and corner.faces[0].rays == 0  # a ray misses an edge
    first = way_of_face(readings, facing, cx, cy, corner, 0, cos_may) if ends else 1.0
    second = way_of_face(readings, facing, cx, cy, corner, 1, cos_may) if ends else 1.0
    for i in range(count):
        q = readings[facing[i]]
        level = level_of(p, s[0].noise_level, q.range_m)
        v = 0.0
        for side in range(2):
            face = corner.faces[side]
            if ends and (first if side == 0 else second) * foot_from_edge(q, corner, side) < 0.0:
                continue
            if face.normal_x * q.axis_x + face.normal_y * q.axis_y >= cos_may:
                v = max(v, log_likelihood(p, level, face_error(q, cx, cy, face)))
        if ends:
            ex = corner.edge_x - q.x
            ey = corner.edge_y - q.y
            d = math.sqrt(ex * ex + ey * ey)
            if ex * q.axis_x + ey * q.axis_y >= cos_may * d:
                v = max(v, log_likelihood(p, level, circle_error(q, ex, ey, d, 0.0)))
        total += v - CORNER_HIT_NAT if v > 0.0 else p[0].table[level, TABLE_BINS - 1]
    return total - CORNER_MODEL_NAT
