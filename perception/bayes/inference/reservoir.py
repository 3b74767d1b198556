"""The raw readings kept by a track: the newest of each bearing.

Hits and silences share the bins, so that new silences replace the hits of an object that has gone, for each bearing
from which the robot observes it again. No reading is dropped for its age. Readings of one bearing never replace those
of another, because a position needs readings from many bearings. What ended in front of an established model says
little of it, and takes free places only: from afar, among furniture, most readings do.

Cross paths come eight at a time and would fill a circle's bins with the last decimetre, so that one in a few is kept
there, for good. All circles share one memory of the others, of the last metre or two, and each takes those that it
may explain. Without any for good a drum was lost that cross paths alone had held against silence.
"""

from __future__ import annotations

import math

from perception.bayes.inference.beam import answer
from perception.bayes.inference.cross_path import is_crossed
from perception.bayes.memory.elements import (
    BEARING_BINS,
    BIN_CAPACITY,
    CROSS_EVERY,
    CROSS_HISTORY,
    CROSSES_MAX,
    HISTORY,
    Reading,
)
from perception.bayes.memory.parameters import HYPOTHESIS_MARGIN_M
from perception.bayes.memory.settings_record import Settings
from perception.bayes.memory.state import CircleTrack, PolygonTrack, State
from perception.kernel import Ints, kernel, loop_kernel
from perception.records import Records


@kernel
def copy_reading(source: Reading, target: Reading) -> None:
    """Copy a reading."""
    target.x = source.x
    target.y = source.y
    target.axis_x = source.axis_x
    target.axis_y = source.axis_y
    target.range_m = source.range_m
    target.listener_x = source.listener_x
    target.listener_y = source.listener_y


@kernel
def keep_reading(
    track: CircleTrack | PolygonTrack, cx: float, cy: float, reading: Reading, replaces: bool = True
) -> bool:  # fmt: skip
    """Put a reading into a track's reservoir, for the oldest one of a full bearing bin; return whether it is there.

    Parameters
    ----------
    track : CircleTrack or PolygonTrack
        Updated.
    cx, cy : float
        The object's centre, m.
    reading : Reading
        Copied.
    replaces : bool
        Whether it may take the place of another one.
    """
    bins = track.bins
    b = int((math.atan2(reading.y - cy, reading.x - cx) / math.tau + 0.5) * len(bins)) % len(bins)
    readings = bins[b].readings
    if not replaces and bins[b].count >= len(readings):
        return False
    copy_reading(reading, readings[bins[b].count % len(readings)])
    bins[b].count += 1
    return True


@kernel
def copy_reservoir(track: CircleTrack | PolygonTrack, readings: Records[Reading]) -> int:
    """Copy all readings of a track to `readings`, echoes before cross paths; return their number."""
    n = 0
    for is_cross in (False, True):
        for b in range(len(track.bins)):
            kept = track.bins[b].readings
            for k in range(min(track.bins[b].count, len(kept))):
                if is_crossed(kept[k]) == is_cross:
                    copy_reading(kept[k], readings[n])
                    n += 1
    return n


@loop_kernel
def mark_crosses(
    crosses: Records[Reading], cx: float, cy: float, radius: float, cos_may: float, gate: float, marks: Ints
) -> None:
    """Mark the cross paths that a circle may explain by 1, others by 0; without a branch, as there are thousands.

    Parameters
    ----------
    crosses : (n,) Reading
        The cross paths.
    cx, cy, radius : float
        The circle, m.
    cos_may, gate : float
        As in `Settings`.
    marks : (≥ n,) int
        Out.
    """
    for k in range(len(crosses)):
        q = crosses[k]
        dx = cx - q.x
        dy = cy - q.y
        d = math.sqrt(dx * dx + dy * dy)
        # Half the way to the listener differs by less than half the distance to it.
        most = gate + 0.5 * (abs(q.listener_x) + abs(q.listener_y))
        inside = min(most - abs(q.range_m + radius - d), dx * q.axis_x + dy * q.axis_y - cos_may * d)
        marks[k] = 1 if inside > 0.0 else 0


@kernel
def add_crosses(
    s: Records[State], p: Records[Settings], cx: float, cy: float, radius: float, readings: Records[Reading], n: int
) -> int:
    """Add the remembered cross paths that a circle may explain to the first `n` readings; return the new number.

    Of more than `CROSSES_MAX` every second counts, or third: evenly over the way they were heard from, which shows
    the shape better than the newest would.

    Parameters
    ----------
    s, p
        Memory and settings.
    cx, cy, radius : float
        The circle, m.
    readings : (≥ n + CROSSES_MAX,) Reading
        Updated.
    n : int
        Readings there.
    """
    found = s[0].scratch.crosses_found
    kept = s[0].crosses[: min(s[0].crosses_kept, CROSS_HISTORY)]
    mark_crosses(kept, cx, cy, radius, p[0].cos_may_answer, p[0].gate_m, found)
    count = 0
    for k in range(len(kept)):
        if found[k] == 1 and k % CROSS_EVERY > 0:  # one of so many is among the circle's own readings
            found[count] = k
            count += 1
    step = (count + CROSSES_MAX - 1) // CROSSES_MAX
    for k in range(0, count, max(step, 1)):
        copy_reading(s[0].crosses[found[k]], readings[n])
        n += 1
    return n


@kernel
def gather_history(s: Records[State], p: Records[Settings], cx: float, cy: float, radius: float) -> int:
    """Copy the remembered readings that bear on a circle, hits and silences, to the scratch; return their number.

    It is heard as the scratch's `predicted` says.

    Parameters
    ----------
    s, p
        Memory, whose scratch is updated, and settings.
    cx, cy, radius : float
        The circle, m.
    """
    readings = s[0].scratch.readings
    cos_may, range_max = p[0].cos_may_answer, p[0].range_max_m
    rays = s[0].scratch.predicted.rays
    n = 0
    for i in range(s[0].sensor_count):
        sensor = s[0].sensors[i]
        for k in range(min(sensor.kept, HISTORY)):
            q = sensor.history[k]
            dx = cx - q.x
            dy = cy - q.y
            dot = dx * q.axis_x + dy * q.axis_y
            if dot <= 0.0:
                continue
            d = math.sqrt(dx * dx + dy * dy)
            if rays > 0:
                beside = abs(q.axis_x * dy - q.axis_y * dx)
                if beside * p[0].cos_half_angle - dot * p[0].sin_half_angle > radius + HYPOTHESIS_MARGIN_M:
                    continue  # the whole circle lies outside the beam
                _, dot = answer(q, dx, dy, d, radius, p[0].half_angle_rad, rays)
            if dot < cos_may * d - HYPOTHESIS_MARGIN_M or d - radius > range_max:
                continue
            if n >= BEARING_BINS * BIN_CAPACITY:
                break
            copy_reading(q, readings[n])
            n += 1
    return add_crosses(s, p, cx, cy, radius, readings, n)
