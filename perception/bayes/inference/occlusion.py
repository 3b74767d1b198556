"""Selection of the readings that bear on an object, given the other known objects.

Two kinds of readings are left out before a body is scored. Hidden ones: a known body between the sensor and this one
blocks the sound, although its own surface may face elsewhere and return no echo; so silence from behind it is not
evidence. And readings that another object explains better, or a named one as well: drums in a row have a common
tangent, and each is hidden by the one before it; with the other drums' echoes in the sum, a wall along all of them
would win.
"""

from __future__ import annotations

import math

from perception.bayes.inference.beam import answer
from perception.bayes.inference.cross_path import is_crossed, is_near_circle
from perception.bayes.inference.noise_estimation import noise_variance, tolerance_m
from perception.bayes.inference.prediction import predict_circle
from perception.bayes.inference.reservoir import copy_reading
from perception.bayes.memory.elements import Reading
from perception.bayes.memory.scratch import TAKES_ALL, TAKES_BETTER, TAKES_NOTHING, OtherCircle
from perception.bayes.memory.settings_record import Settings
from perception.bayes.memory.state import ESTABLISHED, CircleTrack, State
from perception.kernel import kernel
from perception.records import Records


@kernel
def is_elsewhere(track: CircleTrack, p: Records[Settings], cx: float, cy: float, radius: float) -> bool:
    """Return whether a circle's track is another body than a circle about (cx, cy), rather than a part of it.

    Bodies do not overlap, and a rival that all but touches a model is a part of the body that the model stands for:
    an edge of the box that was taken for a drum. It takes no readings from the model, which has to explain them.

    Parameters
    ----------
    track, p
        The track and the settings.
    cx, cy, radius : float
        The circle, m.
    """
    apart: float = p[0].merge_m
    if track.kind >= p[0].model_count:
        apart = max(apart, track.radius + radius + p[0].gate_m)
    return math.hypot(track.x - cx, track.y - cy) >= apart


@kernel
def find_others(
    tracks: Records[CircleTrack],
    own: int,
    p: Records[Settings],
    cx: float,
    cy: float,
    radius: float,
    rays: int,
    others: Records[OtherCircle],
) -> int:
    """Write the established circles other than `own`, and return their number.

    Few of the tracks are in use, and to ask all of them for each reading took half of the time.

    Parameters
    ----------
    tracks, p
        The circles and the settings.
    own : int
        The circle whose readings are asked for; −1 where it has no track yet.
    cx, cy, radius : float
        That circle, m.
    rays : int
        By how many rays circles are heard; see `perception.bayes.inference.beam`.
    others : (≥ n,) OtherCircle
        Out.
    """
    count = 0
    for t in range(len(tracks)):
        track = tracks[t]
        if t == own or track.status != ESTABLISHED:
            continue
        other = others[count]
        other.x = track.x
        other.y = track.y
        other.radius = track.radius
        other.root_xx = track.root_xx
        other.rays = rays
        other.is_named = track.is_named
        is_of_polygon = p[0].polygon_count > 0 and track.kind >= p[0].model_count
        is_rival = not is_of_polygon and is_elsewhere(track, p, cx, cy, radius)
        is_surer = track.is_named == 1 and (own < 0 or tracks[own].is_named == 0)
        other.takes = (TAKES_ALL if is_surer else TAKES_BETTER) if is_rival else TAKES_NOTHING
        count += 1
    return count


@kernel
def is_behind_body(
    others: Records[OtherCircle], x: float, y: float, cx: float, cy: float, d: float, radius: float
) -> bool:
    """Return whether another circle lies between (x, y) and a circle about (cx, cy).

    Parameters
    ----------
    others : (k,) OtherCircle
        The established circles but for this one.
    x, y : float
        The sensor's position, m.
    cx, cy, d, radius : float
        The circle, and the distance of its centre, m.
    """
    ux = (cx - x) / d
    uy = (cy - y) / d
    for i in range(len(others)):
        other = others[i]
        dx = other.x - x
        dy = other.y - y
        if 0.0 < dx * ux + dy * uy < d - radius and abs(dx * uy - dy * ux) < other.radius:
            return True
    return False


@kernel
def is_explained_elsewhere(
    others: Records[OtherCircle], p: Records[Settings], q: Reading, off: float, var0: float, rel2: float
) -> bool:
    """Return whether another established circle explains a reading, with an error smaller than `off`.

    A named one need only explain it: that it fits another place better is chance, where nothing is known to stand.
    Ten such readings of a drive were a drum behind two others, which nothing could contradict.

    Parameters
    ----------
    others
        As for `is_behind_body`.
    p : (1,) Settings
        Beam and gate.
    q : Reading
        The reading.
    off : float
        The circle's error for the reading, m.
    var0, rel2 : float
        From `noise_variance`.
    """
    for i in range(len(others)):
        other = others[i]
        if other.takes == TAKES_NOTHING:
            continue
        dx = other.x - q.x
        dy = other.y - q.y
        d = math.sqrt(dx * dx + dy * dy)
        if other.rays == 0 and dx * q.axis_x + dy * q.axis_y < p[0].cos_may_answer * d:
            continue
        tight = tolerance_m(p[0].half_resolution_m, var0 + rel2 * d * d) + 2.0 * other.root_xx
        if other.rays == 0 and not is_near_circle(q, d, other.radius, tight):
            continue
        e, ahead = answer(q, dx, dy, d, other.radius, p[0].half_angle_rad, other.rays)
        if ahead < p[0].cos_may_answer * d:
            continue
        if abs(e) < (tight if other.takes == TAKES_ALL else min(off, tight)):
            return True
    return False


@kernel
def answers_before(others: Records[OtherCircle], p: Records[Settings], q: Reading) -> bool:
    """Return whether another circle that is named must have answered a cross path sooner: so it comes from none.

    A listener reports the first pulse to arrive. Beams that are wide enough for listening look past bodies at places
    from which nothing can be heard, and what a strayed pulse seems to show there nothing would contradict.

    Parameters
    ----------
    others, p, q
        As for `is_explained_elsewhere`.
    """
    apart = math.sqrt(q.listener_x * q.listener_x + q.listener_y * q.listener_y)
    for i in range(len(others)):
        other = others[i]
        if other.is_named == 0:
            continue
        dx = other.x - q.x
        dy = other.y - q.y
        d = math.sqrt(dx * dx + dy * dy)
        # Half the way over it is longer than the way back by half the listener's distance at most.
        is_before = d - other.radius + 0.5 * apart < q.range_m - p[0].gate_m
        if is_before and dx * q.axis_x + dy * q.axis_y >= p[0].cos_must_answer * d:
            return True
    return False


@kernel
def is_relevant(
    others: Records[OtherCircle],
    p: Records[Settings],
    q: Reading,
    circle: tuple[float, float, float],
    d: float,
    e: float,
    var0: float,
    rel2: float,
) -> bool:
    """Return whether a reading is evidence for or against a circle.

    A range that is too long by more than the gate counts, as a miss, unless another body hides the circle; any other
    range counts unless another circle explains it better. A cross path counts only within the gate, and only if no
    named circle must have answered sooner.

    Parameters
    ----------
    others : record of `OtherCircle`
        The other circles near the reading, from `find_others`.
    p : record of `Settings`
        The ring's.
    q : Reading
        The reading.
    circle : (float, float, float)
        Centre x, y and radius of the circle, m.
    d : float
        Distance of its centre from the sensor, m.
    e : float
        Measured less predicted range, m: above 0, the echo came from beyond the circle.
    var0, rel2 : float
        As for `is_explained_elsewhere`.
    """
    cx, cy, radius = circle
    if is_crossed(q) and (abs(e) > p[0].gate_m or answers_before(others, p, q)):
        return False
    if e > p[0].gate_m:
        return not (d > radius and is_behind_body(others, q.x, q.y, cx, cy, d, radius))
    return not is_explained_elsewhere(others, p, q, abs(e), var0, rel2)


@kernel
def keep_relevant(
    s: Records[State],
    tracks: Records[CircleTrack],
    p: Records[Settings],
    n: int,
    cx: float,
    cy: float,
    radius: float,
    own: int,
) -> int:
    """Drop the readings of the scratch that do not bear on a circle; return the number of those kept.

    Parameters
    ----------
    s, tracks, p
        Memory, whose scratch is packed, circles, and settings.
    n : int
        Number of readings, the first of the scratch.
    cx, cy, radius : float
        Centre and radius, m.
    own : int
        The circle's track; −1 where it has none yet.
    """
    var0, rel2 = noise_variance(s, p)
    scratch = s[0].scratch
    readings, predicted = scratch.readings, scratch.predicted
    others = scratch.others[: find_others(tracks, own, p, cx, cy, radius, predicted.rays, scratch.others)]
    predict_circle(readings[:n], cx, cy, radius, predicted)
    kept = 0
    for j in range(n):
        d, e = predicted.distance[j], predicted.error[j]
        if is_relevant(others, p, readings[j], (cx, cy, radius), d, e, var0, rel2):
            if kept != j:
                copy_reading(readings[j], readings[kept])
            kept += 1
    return kept
