"""Processing of one firing: association, reservoirs, segments, noise estimation, and new hypotheses.

This runs for every firing. Its cost depends on the ring and on the number of tracks, not on the length of the run.
"""

from __future__ import annotations

import math

from perception.bayes.circles.initiation import initiate_circle
from perception.bayes.inference.beam import answer
from perception.bayes.inference.cross_path import is_crossed, is_near_circle
from perception.bayes.inference.noise_estimation import add_roughness, choose_noise, noise_variance, tolerance_m
from perception.bayes.inference.occlusion import is_elsewhere
from perception.bayes.inference.placement import COORDINATE_MAX_M, place_readings
from perception.bayes.inference.reservoir import copy_reading, keep_reading
from perception.bayes.memory.elements import CROSS_EVERY, CROSS_HISTORY, HISTORY, Reading
from perception.bayes.memory.parameters import (
    ASSOCIATION_MARGIN_M,
    HYPOTHESES_PER_FIRING,
    KEEPING_MARGIN_M,
    STILL_COS,
    STILL_M,
)
from perception.bayes.memory.scratch import PROPOSED, UNEXPLAINED, PairSegment
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import ESTABLISHED, FREE, CircleTracks, StateRecord
from perception.bayes.polygons.initiation import request_polygon
from perception.bayes.segments.pairing import make_segments
from perception.bayes.tracks.model_check import count_surroundings
from perception.bayes.tracks.track_selection import is_waiting
from perception.bayes.walls.pose_jitter import place_by_others
from perception.kernel import Floats, Ints, entry_kernel, kernel
from perception.records import Records
from perception.sensor_mounts import RingPose
from perception.shared_numbers import CERTAIN_PROBABILITY, FAR

NO_EVIDENCE, IN_FRONT, BEARS = range(3)
"""What a reading says of a circle: nothing, that something else is before it, or more."""


@kernel
def associate_circles(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, m: int, first: int = 0) -> None:
    """Associate fired readings with the established circles that explain them best.

    Parameters
    ----------
    s, tracks, p
        Memory and circles, updated, and settings.
    m : int
        Number of fired readings, the first of the scratch.
    first : int
        The first of them that is to be associated.
    """
    var0, rel2 = noise_variance(s, p)
    for i in range(first, m):
        q = s[0].scratch.fired[i]
        if q.range_m >= FAR:
            continue
        best = FAR
        for t in range(len(tracks)):
            track = tracks[t]
            if track.status != ESTABLISHED or (p[0].polygon_count > 0 and track.kind >= p[0].model_count):
                continue
            dx = track.x - q.x
            dy = track.y - q.y
            dot = dx * q.axis_x + dy * q.axis_y
            d = math.sqrt(dx * dx + dy * dy)
            if dot <= 0.0 or (s[0].rays == 0 and dot < p[0].cos_may_answer * d - ASSOCIATION_MARGIN_M):
                continue
            tolerance = tolerance_m(p[0].half_resolution_m, var0 + rel2 * d * d) + 2.0 * track.root_xx
            if s[0].rays == 0 and not is_near_circle(q, d, track.radius, tolerance):
                continue
            e, ahead = answer(q, dx, dy, d, track.radius, p[0].half_angle_rad, s[0].rays)
            if ahead < p[0].cos_may_answer * d - ASSOCIATION_MARGIN_M:
                continue
            e = abs(e)
            if e < best and e < tolerance:
                best = e
                s[0].scratch.explained_by[i] = t


@kernel
def bears_on_circle(
    q: Reading, cx: float, cy: float, radius: float, rays: int, is_free: bool, is_own: bool, p: SettingsRecord
) -> int:  # fmt: skip
    """Return whether a reading is evidence for or against a circle, `BEARS`, or only that something is `IN_FRONT`.

    Parameters
    ----------
    q : Reading
        The reading.
    cx, cy, radius : float
        Centre and radius, m.
    rays : int
        By how many rays it is heard, as in `CircleTrack`.
    is_free, is_own : bool
        Whether no other object explains it; whether a hit on this circle would be associated with it.
    p : (1,) Settings
        Beam and gate.
    """
    dx = cx - q.x
    dy = cy - q.y
    dot = dx * q.axis_x + dy * q.axis_y
    if dot <= 0.0:
        return NO_EVIDENCE
    d = math.sqrt(dx * dx + dy * dy)
    if rays == 0 and dot < p[0].cos_may_answer * d - KEEPING_MARGIN_M:
        return NO_EVIDENCE
    if is_crossed(q) and not is_near_circle(q, d, radius, p[0].gate_m):
        return NO_EVIDENCE
    e, dot = answer(q, dx, dy, d, radius, p[0].half_angle_rad, rays)
    if dot < p[0].cos_may_answer * d - KEEPING_MARGIN_M:
        return NO_EVIDENCE
    if is_crossed(q) and abs(e) > p[0].gate_m:
        return NO_EVIDENCE
    if e < -p[0].gate_m:
        return IN_FRONT if is_free and dot >= p[0].cos_must_answer * d else NO_EVIDENCE
    if e > p[0].gate_m:
        return BEARS if dot >= p[0].cos_must_answer * d and d <= p[0].pair_range_max_m else NO_EVIDENCE
    return BEARS if is_own else NO_EVIDENCE


@kernel
def keep_readings(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, m: int) -> None:
    """Put each fired reading into the reservoirs of the circles that it bears on, of the cross paths a few.

    What ends in front of an established model, at something unknown, takes a free place there but replaces nothing:
    heard from afar among furniture, such readings would take the places of its echoes, until it ends. Other circles
    go on losing to them, as most of what seems round in a corridor must.

    The others do not make a sure circle due for refinement: eight at a time, they would several times in a metre, and
    with each its name would be at stake anew, on readings that say the same.

    Parameters
    ----------
    s, tracks, p
        Memory, circles (updated) and settings.
    m : int
        Number of echoes, the first of the scratch; its cross paths follow them.
    """
    offset = s[0].crosses_kept - s[0].scratch.crosses - m  # from a place in the scratch to one in the memory
    for t in range(len(tracks)):
        track = tracks[t]
        if track.status == FREE:
            continue
        track.idle_firings += 1
        is_sure = track.is_named == 1 and track.probability >= CERTAIN_PROBABILITY
        is_model = track.status == ESTABLISHED and track.kind < p[0].model_count
        cx = track.x
        cy = track.y
        for i in range(m + s[0].scratch.crosses):
            q = s[0].scratch.fired[i]
            owner = s[0].scratch.explained_by[i]
            is_own = owner in (UNEXPLAINED, t)
            if 0 <= owner < len(tracks) and not is_own:  # a part of the same body answered
                is_own = not is_elsewhere(tracks[owner], p, cx, cy, track.radius)
            says = bears_on_circle(q, cx, cy, track.radius, s[0].rays, owner == UNEXPLAINED, is_own, p)
            if says != NO_EVIDENCE:
                is_kept = i < m or (i + offset) % CROSS_EVERY == 0
                if is_kept and not keep_reading(track, cx, cy, q, not is_model or says == BEARS):
                    continue
                if is_kept or not is_sure:
                    track.unseen += 1
                track.idle_firings = 0
                track.final_refinements = p[0].final_refinements


@kernel
def update_history(s: StateRecord, p: SettingsRecord, m: int, time_s: float) -> None:
    """Add the firing to the sensors' histories, at their spacing, and update the noise from its roughness.

    Parameters
    ----------
    s, p, m, time_s
        As for `make_segments`.
    """
    for i in range(m):
        q = s[0].scratch.fired[i]
        sensor = s[0].sensors[s[0].scratch.fired_sensors[i]]
        kept = sensor.kept
        last = (kept - 1) % HISTORY
        before = (kept - 2) % HISTORY
        if kept > 0:
            is_near = math.hypot(q.x - sensor.history[last].x, q.y - sensor.history[last].y) < p[0].history_spacing_m
            if is_near and time_s - sensor.times_s[last] < p[0].pair_gap_s:
                continue
        if kept > 1 and q.range_m < FAR:
            add_roughness(
                q,
                sensor.history[last],
                sensor.history[before],
                time_s - sensor.times_s[before],
                p,
                s[0].roughness_nat,
                s[0].room.jitter.level > 0,
            )
        copy_reading(q, sensor.history[kept % HISTORY])
        sensor.times_s[kept % HISTORY] = time_s
        sensor.kept += 1


@kernel
def next_segment(segments: Records[PairSegment], s: StateRecord, p: SettingsRecord, in_turn: bool) -> int:
    """Return the index of the unexplained segment to start a hypothesis from; −1 where none locates a centre well.

    It is the one that locates a centre behind it best, or the best of the sensor that was tried longest ago.

    Parameters
    ----------
    segments : (n,) PairSegment
        Segments of this firing.
    s, p
        Memory and settings.
    in_turn : bool
        Whether the sensors take turns.
    """
    chosen = -1
    best = math.inf
    longest_ago = 0
    for k in range(len(segments)):
        i = segments[k].reading
        r = s[0].scratch.fired[i].range_m
        if s[0].scratch.explained_by[i] == UNEXPLAINED and r <= p[0].pair_range_max_m:
            sigma = segments[k].sigma_direction * (r + p[0].circles[0].radius_m)
            tried = s[0].sensors[s[0].scratch.fired_sensors[i]].tried if in_turn else 0
            is_next = chosen < 0 or tried < longest_ago or (tried == longest_ago and sigma < best)
            if sigma < p[0].hypothesis_sigma_m and is_next:
                best = sigma
                longest_ago = tried
                chosen = k
    return chosen


@kernel
def propose(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, made: int) -> None:
    """Start hypotheses from unexplained segments: the surest, then those of sensors in turn.

    Parameters
    ----------
    s, tracks, p
        Memory and circles, updated, and settings.
    made : int
        Segments of this firing.

    Notes
    -----
    By the surest alone, walls that are heard in every firing would keep a drum waiting.
    """
    segments = s[0].scratch.segments[:made]
    tries = 0
    for _ in range(p[0].attempts_per_firing):
        chosen = next_segment(segments, s, p, tries > 0)
        if chosen < 0:
            return
        at = segments[chosen]
        x, y, nx, ny = at.x, at.y, at.normal_x, at.normal_y
        for kind in range(max(1, p[0].model_count)):
            tries += initiate_circle(s, tracks, p, kind, x, y, nx, ny)
        for model in range(p[0].polygon_count):
            tries += request_polygon(s, model, x, y, nx, ny)
        s[0].scratch.explained_by[at.reading] = PROPOSED
        s[0].sensors[s[0].scratch.fired_sensors[at.reading]].tried = s[0].segments_numbered
        if tries >= HYPOTHESES_PER_FIRING:
            return


@entry_kernel
def associate(
    s: StateRecord,
    tracks: CircleTracks,
    p: SettingsRecord,
    mounts: Floats,
    pose: RingPose,
    time_s: float,
    ranges: Floats,
) -> int:
    """Place the readings of one firing, associate them with circles, and return how many they are.

    Parameters
    ----------
    s, tracks, p
        Memory and circles, updated, and settings.
    mounts : (n, 3) float
        x, y (m), direction (rad) of each sensor in the ring's frame.
    pose : RingPose
        Place (m) and direction (rad) of the ring.
    time_s : float
        The time (s).
    ranges : (n,) float
        Ranges, m; NaN: the sensor did not fire, inf: no echo.
    """
    px, py, yaw = pose
    m = place_readings(s, p, mounts, px, py, yaw, ranges) if math.isfinite(time_s) else 0
    if m > 0:
        count_surroundings(s, m, math.hypot(px - s[0].ring_x, py - s[0].ring_y))
        s[0].ring_x = px
        s[0].ring_y = py
        place_by_others(s, p, m)
    associate_circles(s, tracks, p, m)
    return m


@kernel
def hear_crosses(
    s: StateRecord,
    tracks: CircleTracks,
    p: SettingsRecord,
    mounts: Floats,
    pose: RingPose,
    m: int,
    transmitters: Ints,
    listeners: Ints,
    half_paths: Floats,
) -> None:
    """Write the cross paths of a firing to the scratch, behind its echoes, remember them, and associate them.

    Those that were not heard are left out, and all of a transmitter that has hardly moved since others last listened
    to it: a robot that stands still would fill the reservoirs with one look.

    Parameters
    ----------
    s, tracks, p, mounts
        As for `associate`, which has placed the firing's echoes.
    pose : RingPose
        Place (m) and direction (rad) of the ring.
    m : int
        Echoes of this firing.
    transmitters, listeners, half_paths
        As in `drivers.messages.CrossPaths`.
    """
    px, py, yaw = pose
    if not (abs(px) < COORDINATE_MAX_M and abs(py) < COORDINATE_MAX_M and math.isfinite(yaw)):
        return
    scratch = s[0].scratch
    c = math.cos(yaw)
    sn = math.sin(yaw)
    end = m
    for k in range(len(half_paths)):
        i, j = transmitters[k], listeners[k]
        if not 0.0 <= half_paths[k] < p[0].range_max_m or i == j or end == len(scratch.fired):
            continue
        q = scratch.fired[end]
        q.x = px + c * mounts[i, 0] - sn * mounts[i, 1]
        q.y = py + sn * mounts[i, 0] + c * mounts[i, 1]
        q.axis_x = math.cos(yaw + mounts[i, 2])
        q.axis_y = math.sin(yaw + mounts[i, 2])
        q.range_m = half_paths[k]
        q.listener_x = c * (mounts[j, 0] - mounts[i, 0]) - sn * (mounts[j, 1] - mounts[i, 1])
        q.listener_y = sn * (mounts[j, 0] - mounts[i, 0]) + c * (mounts[j, 1] - mounts[i, 1])
        before = s[0].sensors[i].crossed
        is_still = math.hypot(q.x - before.x, q.y - before.y) < STILL_M
        if is_still and q.axis_x * before.axis_x + q.axis_y * before.axis_y > STILL_COS:
            continue
        scratch.fired_sensors[end] = i
        scratch.explained_by[end] = UNEXPLAINED
        end += 1
    for k in range(m, end):
        copy_reading(scratch.fired[k], s[0].crosses[s[0].crosses_kept % CROSS_HISTORY])
        copy_reading(scratch.fired[k], s[0].sensors[scratch.fired_sensors[k]].crossed)
        s[0].crosses_kept += 1
    scratch.crosses = end - m
    associate_circles(s, tracks, p, end, m)


@entry_kernel
def observe(
    s: StateRecord, tracks: CircleTracks, p: SettingsRecord, m: int, time_s: float, threshold: float
) -> tuple[int, bool]:
    """Process associated readings, without refinement; return the segments made, and whether a circle waits for it.

    Parameters
    ----------
    s, tracks, p
        Memory and circles, updated, and settings.
    m : int
        Readings of this firing.
    time_s : float
        Its time, s.
    threshold : float
        Unseen evidence for an object's size from which on it waits for refinement.

    Returns
    -------
    (int, bool)
        Outline segments made, and whether a circle waits for refinement.
    """
    keep_readings(s, tracks, p, m)
    made = make_segments(s, p, m, time_s)
    update_history(s, p, m, time_s)
    choose_noise(s, p)
    propose(s, tracks, p, made)
    return made, is_waiting(tracks, p, threshold)
