"""Pairing of unexplained readings into outline segments: with earlier readings and with neighbours in the ring.

Paper §3.2, after McKerrow; each segment comes with its uncertainty.
"""

from __future__ import annotations

import math

from perception.bayes.inference.noise_estimation import noise_variance
from perception.bayes.memory.elements import HISTORY, Reading
from perception.bayes.memory.parameters import (
    BASELINE_MAX_M,
    BASELINE_MIN_M,
    BASELINES,
    MAPPED_LENGTH_MIN_M,
    NEIGHBOUR_BASELINE_MIN_M,
    TRIPLE_MAX_M,
)
from perception.bayes.memory.scratch import PairSegment
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import StateRecord
from perception.bayes.segments.segment_list import put_segment
from perception.bayes.segments.segment_pairs import tangent
from perception.kernel import kernel
from perception.shared_numbers import FAR


@kernel
def add_pair(s: StateRecord, p: SettingsRecord, i: int, other: Reading, var: float, made: int) -> int:
    """Make a segment of fired reading `i` and another reading; return the new number of segments.

    Parameters
    ----------
    s, p
        Memory, whose scratch takes the segment, and settings.
    i : int
        The fired reading.
    other : Reading
        The other one.
    var : float
        Variance of a range, m².
    made : int
        Segments so far.
    """
    segments = s[0].scratch.segments
    if other.range_m >= FAR or made >= len(segments):
        return made
    if not tangent(other, s[0].scratch.fired[i], p[0].cos_half_angle, var, segments[made]):
        return made
    segments[made].reading = i
    return made + 1


@kernel
def pair_in_time(s: StateRecord, p: SettingsRecord, i: int, time_s: float, var: float, made: int) -> int:
    """Pair a reading with its own sensor's history at three baselines; return the new number of segments.

    A short baseline gives a segment early, a long one gives a certain direction.

    Parameters
    ----------
    s, p, i, var, made
        As for `add_pair`.
    time_s : float
        Time of the firing.
    """
    q = s[0].scratch.fired[i]
    sensor = s[0].sensors[s[0].scratch.fired_sensors[i]]
    step = 0
    for back in range(min(sensor.kept, HISTORY)):
        at = (sensor.kept - 1 - back) % HISTORY
        old = sensor.history[at]
        if time_s - sensor.times_s[at] > p[0].pair_gap_s:
            break
        base = math.hypot(q.x - old.x, q.y - old.y)
        if base < BASELINE_MIN_M * (1 << step):
            continue
        if base > BASELINE_MAX_M:
            break
        step += 1
        made = add_pair(s, p, i, old, var, made)
        if step == BASELINES:
            break
    return made


@kernel
def pair_in_ring(s: StateRecord, p: SettingsRecord, i: int, m: int, time_s: float, var: float, made: int) -> int:
    """Pair a reading with its ring neighbours' (of this firing, else the newest); return the new number of segments.

    Parameters
    ----------
    s, p, i, time_s, var, made
        As for `pair_in_time`.
    m : int
        Fired readings.
    """
    fired, sensors = s[0].scratch.fired, s[0].scratch.fired_sensors
    q = fired[i]
    for side in (-1, 1):
        neighbour = (sensors[i] + side) % s[0].sensor_count
        other = s[0].sensors[neighbour]
        if other.kept == 0:
            continue
        has_fired = False
        for k in (i - 1, i + 1, 0, m - 1):
            if 0 <= k < m and sensors[k] == neighbour:
                if side == 1:  # the neighbour makes this pair in its own turn
                    made = add_pair(s, p, i, fired[k], var, made)
                has_fired = True
                break
        if not has_fired:
            at = (other.kept - 1) % HISTORY
            old = other.history[at]
            base = math.hypot(q.x - old.x, q.y - old.y)
            if time_s - other.times_s[at] < p[0].pair_gap_s and NEIGHBOUR_BASELINE_MIN_M < base < TRIPLE_MAX_M:
                made = add_pair(s, p, i, old, var, made)
    return made


@kernel
def map_segment(s: StateRecord, segment: PairSegment, time_s: float) -> None:
    """Put a segment into the outline map under the next segment number.

    Parameters
    ----------
    s : (1,) State
        Memory, updated.
    segment : PairSegment
        The segment.
    time_s : float
        Time of the firing, s.
    """
    s[0].segments_numbered += 1
    put_segment(s, segment.x, segment.y, segment.normal_x, segment.normal_y, s[0].segments_numbered, time_s)


@kernel
def make_segments(s: StateRecord, p: SettingsRecord, m: int, time_s: float) -> int:
    """Pair the firing's echoes in time and in the ring, and map the segments; return the number of segments.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    m : int
        Fired readings.
    time_s : float
        Time of the firing.
    """
    var0, rel2 = noise_variance(s, p)
    scratch = s[0].scratch
    made = 0
    for i in range(m):
        r = scratch.fired[i].range_m
        if r < FAR:
            var = var0 + rel2 * r * r
            made = pair_in_time(s, p, i, time_s, var, made)
            made = pair_in_ring(s, p, i, m, time_s, var, made)
    for k in range(made):
        if scratch.segments[k].length > MAPPED_LENGTH_MIN_M:
            map_segment(s, scratch.segments[k], time_s)
    s[0].segments_made += made
    return made
