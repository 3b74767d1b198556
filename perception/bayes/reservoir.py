"""The raw readings kept by a track: the newest of each bearing.

Hits and silences share the bins, so that new silences replace the hits of an object that has gone, for each bearing
from which the robot observes it again. No reading is dropped for its age. Readings of one bearing never replace those
of another, because a position needs readings from many bearings.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.elements import CROSS_HISTORY, HISTORY, Reading
from perception.bayes.parameters import HYPOTHESIS_MARGIN_M
from perception.bayes.settings_record import Settings
from perception.bayes.state import CircleTrack, PolygonTrack, State
from perception.kernel import kernel
from perception.records import Records

TWO_PI: Final = 2.0 * math.pi
ROOM: Final = 64
"""Places left free at the end of the scratch's readings."""


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
def keep_reading(track: CircleTrack | PolygonTrack, cx: float, cy: float, reading: Reading) -> None:
    """Put a reading into a track's reservoir; it replaces the oldest reading of a full bearing bin.

    Parameters
    ----------
    track : CircleTrack or PolygonTrack
        Updated.
    cx, cy : float
        The object's centre, m.
    reading : Reading
        Copied.
    """
    bins = track.bins
    b = int((math.atan2(reading.y - cy, reading.x - cx) / TWO_PI + 0.5) * len(bins)) % len(bins)
    readings = bins[b].readings
    copy_reading(reading, readings[bins[b].count % len(readings)])
    bins[b].count += 1


@kernel
def copy_reservoir(track: CircleTrack | PolygonTrack, readings: Records[Reading]) -> int:
    """Copy all readings of a track to `readings`; return their number."""
    n = 0
    for b in range(len(track.bins)):
        kept = track.bins[b].readings
        for k in range(min(track.bins[b].count, len(kept))):
            copy_reading(kept[k], readings[n])
            n += 1
    return n


@kernel
def may_bear(p: Records[Settings], q: Reading, cx: float, cy: float, radius: float) -> bool:
    """Return whether a circle may lie in a reading's beam and reach.

    Parameters
    ----------
    p, q
        Settings and the reading.
    cx, cy, radius : float
        The circle, m.
    """
    dx = cx - q.x
    dy = cy - q.y
    dot = dx * q.axis_x + dy * q.axis_y
    if dot <= 0.0:
        return False
    d = math.sqrt(dx * dx + dy * dy)
    return not (dot < p[0].cos_may_answer * d - HYPOTHESIS_MARGIN_M or d - radius > p[0].range_max_m)


@kernel
def gather_history(s: Records[State], p: Records[Settings], cx: float, cy: float, radius: float) -> int:
    """Copy the remembered readings that bear on a circle, hits and silences, to the scratch; return their number.

    Parameters
    ----------
    s, p
        Memory, whose scratch is updated, and settings.
    cx, cy, radius : float
        The circle, m.
    """
    readings = s[0].scratch.readings
    n = 0
    for i in range(s[0].sensor_count):
        sensor = s[0].sensors[i]
        for k in range(min(sensor.kept, HISTORY)):
            if not may_bear(p, sensor.history[k], cx, cy, radius):
                continue
            if n >= len(readings) - ROOM:
                return n
            copy_reading(sensor.history[k], readings[n])
            n += 1
    kept = s[0].crosses_kept
    for k in range(min(kept, CROSS_HISTORY)):
        q = s[0].crosses[(kept - 1 - k) % CROSS_HISTORY]
        if may_bear(p, q, cx, cy, radius):
            if n >= len(readings) - ROOM:
                return n
            copy_reading(q, readings[n])
            n += 1
    return n
