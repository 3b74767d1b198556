"""The kernels behind `perception.sensor_faults.monitor`: each reading tested for a stuck, silent or disturbed sensor.

Each test compares a sensor's readings with those that a healthy sensor would have given. It requires several kinds of
evidence: the path of the base, the neighbours' readings in the meantime, and the rest of the ring.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.kernel import Floats, Ints, entry_kernel, kernel
from perception.records import Records
from perception.sensor_faults.crosstalk import count_short_readings, find_set, is_doubtful
from perception.sensor_faults.maximum import stands_for_nothing
from perception.sensor_faults.memory import RingMemory, RingSetup, SensorMemory
from perception.sensor_faults.report import AT_MAXIMUM, CROSSTALK, FAILING, SILENT, STUCK, TOO_NEAR
from perception.sensor_faults.silence import weigh_silence
from perception.sensor_faults.too_near import count_too_near
from perception.sensor_faults.turning import follow_turn, repeats_through_turn
from perception.sensor_faults.wall import NOISE_SHARE, is_along_wall
from perception.sensor_mounts import RingPose
from perception.shared_numbers import SAME_ECHO_M

# The thresholds below were tuned on the simulated halls of tests/perception/sensor_faults/test_monitor.py: no healthy
# sensor is masked in any hall, and every faulty one is found.

APPROACH_MIN_M: Final = 1.0
"""Stuck: the base has come at least this much nearer to the reflecting surface, wherever in the beam it is, m."""
EQUAL_READINGS_MIN: Final = 20
"""Stuck after approaching: at least so many equal readings; fewer occur by chance."""
NEIGHBOUR_CHANGES_MIN: Final = 4
"""Stuck: the reading of either neighbour has changed this often in the meantime. If the base has only passed by, the
readings must have leapt instead: a rough wall along the path gives equal readings to all sensors that face it."""
PASSED_MIN_M: Final = 2.0
"""Stuck after passing by: the base has moved at least this far, m."""
PASSED_READINGS_MIN: Final = 40
"""Stuck after passing by: at least so many equal readings."""
PASSED_CHANGES_MIN: Final = 12
"""Stuck after passing by: changes of either neighbour's reading that count even without leaps."""
REGULARITY_MIN: Final = 0.8
"""Below this regularity the sets do not recur, and crosstalk is not tested."""
RECOVERY_READINGS: Final = 5
"""Consecutive readings away from the stuck value that clear a stuck sensor."""

MISSED_FIRINGS_MAX: Final = 72
"""Firings of the ring without a reading that make a sensor failing: three rounds of the longest pattern."""

FAULTS_CHANGED, LESS_TRUSTED, LESS_POSSIBLE = 1, 2, 4
"""Bits of `check_firing`'s result: a fault began or ended; readings are not trusted; readings are masked."""


@kernel
def begin_run(
    i: int, r: float, x: float, y: float, yaw: float, neighbours: Ints, sensors: Records[SensorMemory]
) -> None:
    """Begin a run of readings equal to `r` for sensor `i` at the ring's pose (m, rad).

    Parameters
    ----------
    i : int
        Index of the sensor.
    r : float
        The reading that the run repeats, m; inf for a run without echoes.
    x, y, yaw : float
        Pose of the ring now, in the odometry's frame, m and rad.
    neighbours : (n, 2) int
        Indices of each sensor's left and right neighbour; −1 for both without two.
    sensors : (n,) records
        What is remembered of each sensor. The run of sensor `i` is overwritten.
    """
    c = sensors[i]
    c.run_m, c.run_x, c.run_y, c.run_yaw, c.run_length = r, x, y, yaw, 1
    for side in range(2):
        counts, then = sensors[neighbours[i, side]].counts, c.run_neighbours[side]
        then.changes, then.leaps = counts.changes, counts.leaps


@kernel
def is_off(r: float, steady: float, tolerance: float) -> bool:
    """Return whether a reading differs from a steady one (m, or inf) by more than the tolerance and noise."""
    return bool(r != steady and not abs(r - steady) <= tolerance + NOISE_SHARE * min(r, steady))


@kernel
def count_changes(c: SensorMemory, r: float, tolerance: float) -> None:
    """Count a change of what a sensor reads: two readings in turn that are off the steady one.

    Single stray readings come along every wall, by drop-outs, the echoes of others and noise: they say nothing of
    whether the surface comes nearer.

    Parameters
    ----------
    c : record
        What is remembered of the sensor. Its counts are updated.
    r : float
        Its new reading, m.
    tolerance : float
        Readings that differ by no more than this are equal, m.
    """
    first = c.readings == 0
    has_changed = not first and is_off(r, c.steady_m, tolerance) and is_off(c.last_m, c.steady_m, tolerance)
    if first or has_changed:
        steady = r if first else c.last_m
        c.counts.changes += 1
        c.counts.leaps += has_changed and not abs(steady - c.steady_m) <= SAME_ECHO_M
        c.steady_m = steady


@kernel
def neighbour_counts(
    i: int, neighbours: Ints, sensors: Records[SensorMemory], skip_deaf: bool
) -> tuple[float, float]:
    """Return the lesser of both neighbours' changes and leaps since sensor `i`'s run began.

    Both are zero for a sensor without two neighbours.

    Parameters
    ----------
    i : int
        Index of the sensor.
    neighbours : (n, 2) int
        Indices of each sensor's left and right neighbour; −1 for both without two.
    sensors : (n,) records
        What is remembered of each sensor.
    skip_deaf : bool
        Leave out a neighbour that hears no echo at present.
    """
    changes = leaps = math.inf
    for side in range(2):
        k = neighbours[i, side]
        if k < 0:
            return 0.0, 0.0
        if not (skip_deaf and math.isinf(sensors[k].steady_m)):
            counts, then = sensors[k].counts, sensors[i].run_neighbours[side]
            changes = min(changes, float(counts.changes - then.changes))
            leaps = min(leaps, float(counts.leaps - then.leaps))
    if not math.isfinite(changes):
        return 0.0, 0.0
    return changes, leaps


@kernel
def others_changed(i: int, sensors: Records[SensorMemory]) -> bool:
    """Return whether most other sensors that hear an echo have changed their reading since sensor `i`'s run began."""
    changed = 0
    others = 0
    for k in range(len(sensors)):
        c = sensors[k]
        if k != i and c.readings > 0 and math.isfinite(c.last_m) and c.faults & STUCK == 0:
            others += 1
            if c.run_firing > sensors[i].run_firing:
                changed += 1
    return bool(changed >= 2 and 2 * changed >= others)


@kernel
def is_stuck(
    i: int, x: float, y: float, axis: float, half_angle: float, neighbours: Ints, sensors: Records[SensorMemory]
) -> bool:
    """Return whether a healthy sensor would have changed its reading by now.

    A surface whose normal lies within ±β of the axis comes nearer by at least d·cos(ψ ∓ β) when the base moves by d
    at an angle ψ to the axis: by d·cos ψ·cos β − d·sin ψ·sin β.

    Parameters
    ----------
    i : int
        The sensor.
    x, y : float
        Place of the ring, m.
    axis, half_angle : float
        Direction of the sensor's axis in the odometry's frame, and half the beam's width β, rad.
    neighbours : (n, 2) int
        Each sensor's neighbours.
    sensors : (n,) records
        What is remembered of each sensor.
    """
    c = sensors[i]
    dx, dy = x - c.run_x, y - c.run_y
    along = abs(dx * math.cos(axis) + dy * math.sin(axis))
    across = abs(dy * math.cos(axis) - dx * math.sin(axis))
    approach = along * math.cos(half_angle) - across * math.sin(half_angle)
    stuck = False
    if approach >= APPROACH_MIN_M and c.run_length >= EQUAL_READINGS_MIN:
        changes, _ = neighbour_counts(i, neighbours, sensors, True)  # noqa: FBT003 - kernels take no keywords
        stuck = changes >= NEIGHBOUR_CHANGES_MIN
    if not stuck and math.hypot(dx, dy) >= PASSED_MIN_M and c.run_length >= PASSED_READINGS_MIN:
        changes, leaps = neighbour_counts(i, neighbours, sensors, False)  # noqa: FBT003 - kernels take no keywords
        stuck = leaps >= NEIGHBOUR_CHANGES_MIN or changes >= PASSED_CHANGES_MIN
    return bool(stuck and others_changed(i, sensors))


@kernel
def update_run_faults(
    i: int,
    r: float,
    x: float,
    y: float,
    axis: float,
    setup: RingSetup,
    sensors: Records[SensorMemory],
    ring: Records[RingMemory],
) -> None:
    """Set or clear sensor `i`'s fault `STUCK` from its run of equal readings.

    Parameters
    ----------
    i : int
        The sensor.
    r : float
        Its new reading, m.
    x, y, axis, sensors
        As for `is_stuck`.
    setup : RingSetup
        What is known of the ring beforehand.
    ring : (1,) record
        What is remembered of the ring.
    """
    c = sensors[i]
    if c.faults & STUCK:
        c.off_stuck = 0 if abs(r - c.stuck_m) <= setup.tolerance else c.off_stuck + 1
        if c.off_stuck >= RECOVERY_READINGS:
            c.faults &= ~STUCK
    elif math.isfinite(r) and (
        is_stuck(i, x, y, axis, setup.half_angle, setup.neighbours, sensors)
        or repeats_through_turn(i, r, sensors, ring)
    ):
        c.faults |= STUCK
        c.stuck_m, c.off_stuck = c.run_m, 0


@kernel
def follow_run(
    i: int,
    r: float,
    pose: RingPose,
    setup: RingSetup,
    sensors: Records[SensorMemory],
    ring: Records[RingMemory],
) -> None:
    """Count a reading to the run of equal readings of sensor `i`, or begin another run.

    A run also begins anew where a healthy sensor goes on reading the same: once it has turned, and along a wall.

    Parameters
    ----------
    i, r, pose, setup, sensors, ring
        As for `check_firing`; `r` is the reading of sensor `i`. Its run is updated.
    """
    x, y, yaw = pose
    own_yaw = yaw + setup.turns[i]
    c = sensors[i]
    if c.run_length == 0 or not (r == c.run_m or abs(r - c.run_m) <= setup.tolerance):
        c.run_firing = ring[0].firings
        begin_run(i, r, x, y, own_yaw, setup.neighbours, sensors)
    elif abs(own_yaw - c.run_yaw) > 0.5 * setup.half_angle or is_along_wall(i, x, y, own_yaw, yaw, setup, sensors):
        begin_run(i, c.run_m, x, y, own_yaw, setup.neighbours, sensors)
    else:
        c.run_length += 1


@kernel
def lost_trust(c: SensorMemory, r: float, fired_set: int, least: float) -> int:
    """Return the bits `LESS_TRUSTED` and `LESS_POSSIBLE` of a reading, by the faults of its sensor.

    Parameters
    ----------
    c : record
        What is remembered of the sensor.
    r : float
        Its reading, m.
    fired_set : int
        The set that fired, as of `find_set`.
    least : float
        Ranges below this cannot be measured, m.
    """
    if c.faults & (STUCK | TOO_NEAR) or c.is_crossed[fired_set]:
        return LESS_TRUSTED | LESS_POSSIBLE
    return LESS_TRUSTED if r < least or (c.faults & SILENT and not math.isfinite(r)) else 0


@entry_kernel
def check_firing(
    ranges: Floats,
    pose: RingPose,
    setup: RingSetup,
    sensors: Records[SensorMemory],
    ring: Records[RingMemory],
    sets: NDArray[np.uint8],
    trusted: Floats,
    possible: Floats,
) -> int:
    """Test the readings of a firing; return the bits `FAULTS_CHANGED`, `LESS_TRUSTED` and `LESS_POSSIBLE`.

    Parameters
    ----------
    ranges : (n,) float
        As in a `Firing`, m.
    pose : RingPose
        Place (m) and direction (rad) of the ring.
    setup : RingSetup
        What is known of the ring beforehand.
    sensors : (n,) records
        What is remembered of each sensor. Updated.
    ring : (1,) record
        What is remembered of the ring. Updated.
    sets : (SETS_MAX, n) uint8
        1 where a sensor belongs to a set. Updated.
    trusted, possible : (n,) float
        Out: the readings that are trusted; those and the doubtful ones, m. NaN for the others.
    """
    x, y, yaw = pose
    mounts, half_angle = setup.mounts, setup.half_angle
    fired = 0
    for i in range(ranges.shape[0]):
        trusted[i] = possible[i] = ranges[i]
        fired += not math.isnan(ranges[i])
    if fired == 0 or not math.isfinite(x + y + yaw):
        return 0
    fired_set = find_set(ranges, sets, sensors, ring)
    ring[0].firings += 1
    has_leapt = math.hypot(x - ring[0].x, y - ring[0].y) >= APPROACH_MIN_M
    ring[0].x, ring[0].y = x, y
    follow_turn(x, y, yaw, ring)
    changed = 0
    for i in range(ranges.shape[0]):
        c = sensors[i]
        if has_leapt:
            c.run_length = 0
        before = c.faults
        r = ranges[i]
        if math.isnan(r):
            c.missed += 1
            if setup.expected[i] and c.missed >= MISSED_FIRINGS_MAX:
                c.faults |= FAILING
            if c.faults != before:
                changed |= FAULTS_CHANGED
            continue
        c.missed = 0
        c.faults &= ~FAILING
        own_yaw = yaw + setup.turns[i]
        axis = own_yaw + mounts[i, 2]
        cos, sin = math.cos(own_yaw), math.sin(own_yaw)
        own_x, own_y = x + cos * mounts[i, 0] - sin * mounts[i, 1], y + sin * mounts[i, 0] + cos * mounts[i, 1]
        if stands_for_nothing(r, own_x, own_y, axis, setup, ring):
            r = trusted[i] = possible[i] = math.inf
            c.faults |= AT_MAXIMUM
            changed |= LESS_TRUSTED | LESS_POSSIBLE
        elif not ring[0].is_maximum_nothing:
            c.faults &= ~AT_MAXIMUM
        count_changes(c, r, setup.tolerance)
        follow_run(i, r, pose, setup, sensors, ring)
        update_run_faults(i, r, x, y, axis, setup, sensors, ring)
        c.faults &= ~SILENT
        if weigh_silence(i, r, own_x, own_y, axis, half_angle, setup.near, sensors, ring):
            c.faults |= SILENT
        if ring[0].regularity >= REGULARITY_MIN:
            count_short_readings(c, r, fired_set)
            if is_doubtful(c, r, x, y, fired_set):
                trusted[i] = math.nan
                changed |= LESS_TRUSTED
        c.before_last_m, c.before_last_set = c.last_m, c.last_set
        c.last_m, c.last_set = r, fired_set
        c.last_x, c.last_y = x, y
        c.readings += 1
        c.faults &= ~CROSSTALK
        for k in range(sets.shape[0]):
            if c.is_crossed[k]:
                c.faults |= CROSSTALK
        count_too_near(c, r < setup.least, ring)
        lost = lost_trust(c, r, fired_set, setup.least)
        if lost & LESS_TRUSTED:
            trusted[i] = math.nan
        if lost & LESS_POSSIBLE:
            possible[i] = math.nan
        changed |= lost
        if c.faults != before:
            changed |= FAULTS_CHANGED
    return changed
