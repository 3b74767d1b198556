"""The kernels behind `perception.sensor_monitor`: tests of each reading for stuck, silent and cross-talking sensors.

Each test compares a sensor's readings with those that a healthy sensor would have given. It requires several kinds of
evidence: the path of the base, the neighbours' readings in the meantime, and the rest of the ring.
"""

from __future__ import annotations

import math
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray

from perception.kernel import Floats, Ints, kernel
from perception.records import Record, Records
from perception.sensor_report import CROSSTALK, FAILING, SILENT, STUCK

# The thresholds below were tuned on the simulated halls of tests/perception/test_sensor_monitor.py: no healthy sensor
# is masked in any hall, and every faulty one is found.

SETS_MAX: Final = 32
"""Sets of sensors that fire together that are distinguished; a firing pattern has at most 24."""
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
"""Stuck after passing by, or silent: at least so many equal readings."""
PASSED_CHANGES_MIN: Final = 20
"""Stuck after passing by: changes of either neighbour's reading that count even without leaps."""
SILENT_MIN_M: Final = 5.0
"""Silent: the base has moved at least this far without an echo, m; free space is common."""
NEAR_ECHO_SHARE: Final = 0.5
"""Silent: near echoes of either neighbour for each firing without an echo."""
LEAP_M: Final = 0.3
"""A change of the reading by more than this is a leap, m."""
SHORT_M: Final = 0.15
"""Crosstalk: a reading is short if it is below those before and after it by this, m, …"""
SHORT_SHARE: Final = 0.05
"""… and by this share of them."""
REGULARITY_GAIN: Final = 0.05
"""Weight of the newest firing in the regularity of the firing pattern."""
REGULARITY_MIN: Final = 0.8
"""Below this regularity the sets do not recur, and crosstalk is not tested."""
SHORT_READINGS_MAX: Final = 8.0
"""Short readings that are crosstalk; each other reading subtracts two."""
RECOVERY_READINGS: Final = 5
"""Consecutive readings away from the stuck value that clear a stuck sensor."""
MISSED_FIRINGS_MAX: Final = 72
"""Firings of the ring without a reading that make a sensor failing: three rounds of the longest pattern."""

FAULTS_CHANGED, LESS_TRUSTED, LESS_POSSIBLE = 1, 2, 4
"""Bits of `check_firing`'s result: a fault began or ended; readings are not trusted; readings are masked."""


class NeighbourCounts(Record):
    """A sensor's running counts, against which its neighbours are compared."""

    changes: int
    """Changes of the reading beyond the tolerance."""
    leaps: int
    """Changes of the reading by more than `LEAP_M`."""
    near_echoes: int
    """Echoes nearer than the near limit."""


class SensorMemory(Record):
    """What is remembered of one sensor."""

    readings: int
    """Readings since the start or the last reset."""
    last_m: float
    """The last reading, m."""
    before_last_m: float
    last_set: int
    """The set it fired in at the last reading."""
    before_last_set: int
    last_x: float
    """Place of the ring at the last reading, m."""
    last_y: float
    counts: NeighbourCounts
    missed: int
    """Firings of the ring since the last reading."""
    run_m: float
    """The run of equal readings: its value, m."""
    run_firing: int
    """The firing of the ring in which it began."""
    run_length: int
    """Its readings."""
    run_x: float
    """Pose of the ring when it began, m and rad."""
    run_y: float
    run_yaw: float
    run_neighbours: Annotated[Records[NeighbourCounts], 2]
    """The neighbours' counts when it began."""
    stuck_m: float
    """The value it is stuck at, m."""
    off_stuck: int
    """Consecutive readings away from that value."""
    faults: int
    """Fault bits of `perception.sensor_report`."""
    short_readings: Annotated[Floats, SETS_MAX]
    """For each set, short readings less those that were not."""
    is_crossed: Annotated[Ints, SETS_MAX]
    """For each set, 1 where the sensor is masked for crosstalk."""


class RingMemory(Record):
    """What is remembered of the ring as a whole."""

    firings: int
    sets_seen: int
    """Different sets met so far; a set that was replaced and recurs counts again."""
    x: float
    """Place of the last firing, m."""
    y: float
    regularity: float
    """Recent share of firings whose set was known."""


@kernel
def find_set(
    ranges: Floats, sets: NDArray[np.uint8], sensors: Records[SensorMemory], ring: Records[RingMemory]
) -> int:
    """Return the index of the set of sensors that fired; enter a new set, over the oldest where all are in use.

    Parameters
    ----------
    ranges : (n,) float
        Readings of the firing, m: NaN for a sensor that did not fire, inf for one without an echo.
    sets : (sets, n) uint8
        Known sets, one a row: 1 for each sensor of the set. A new set overwrites a row.
    sensors : (n,) records
        What is remembered of each sensor. Crosstalk counts of an overwritten set are cleared.
    ring : (1,) records
        What is remembered of the ring. The number of sets and the regularity are updated.
    """
    seen = ring[0].sets_seen
    k: int
    for k in range(min(seen, sets.shape[0])):
        same = True
        for i in range(ranges.shape[0]):
            if (sets[k, i] == 1) == math.isnan(ranges[i]):
                same = False
                break
        if same:
            ring[0].regularity += REGULARITY_GAIN * (1.0 - ring[0].regularity)
            return k
    ring[0].regularity -= REGULARITY_GAIN * ring[0].regularity
    k = seen % sets.shape[0]
    for i in range(ranges.shape[0]):
        sets[k, i] = 0 if math.isnan(ranges[i]) else 1
        sensors[i].short_readings[k] = 0.0
        sensors[i].is_crossed[k] = 0
    ring[0].sets_seen += 1
    return k


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
        then.changes, then.leaps, then.near_echoes = counts.changes, counts.leaps, counts.near_echoes


@kernel
def neighbour_counts(
    i: int, neighbours: Ints, sensors: Records[SensorMemory], skip_deaf: bool
) -> tuple[float, float, float]:
    """Return the lesser of both neighbours' changes, leaps and near echoes since sensor `i`'s run began.

    All three are zero for a sensor without two neighbours.

    Parameters
    ----------
    i : int
        Index of the sensor.
    neighbours : (n, 2) int
        Indices of each sensor's left and right neighbour; −1 for both without two.
    sensors : (n,) records
        What is remembered of each sensor.
    skip_deaf : bool
        Leave out a neighbour whose last reading was without an echo.
    """
    changes = leaps = near_echoes = math.inf
    for side in range(2):
        k = neighbours[i, side]
        if k < 0:
            return 0.0, 0.0, 0.0
        if not (skip_deaf and math.isinf(sensors[k].last_m)):
            counts, then = sensors[k].counts, sensors[i].run_neighbours[side]
            changes = min(changes, float(counts.changes - then.changes))
            leaps = min(leaps, float(counts.leaps - then.leaps))
            near_echoes = min(near_echoes, float(counts.near_echoes - then.near_echoes))
    if not math.isfinite(changes):
        return 0.0, 0.0, 0.0
    return changes, leaps, near_echoes


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
        changes, _, _ = neighbour_counts(i, neighbours, sensors, True)  # noqa: FBT003 - kernels take no keywords
        stuck = changes >= NEIGHBOUR_CHANGES_MIN
    if not stuck and math.hypot(dx, dy) >= PASSED_MIN_M and c.run_length >= PASSED_READINGS_MIN:
        changes, leaps, _ = neighbour_counts(i, neighbours, sensors, False)  # noqa: FBT003
        stuck = leaps >= NEIGHBOUR_CHANGES_MIN or changes >= PASSED_CHANGES_MIN
    return bool(stuck and others_changed(i, sensors))


@kernel
def is_silent(i: int, x: float, y: float, neighbours: Ints, sensors: Records[SensorMemory]) -> bool:
    """Return whether a healthy sensor would have heard an echo by now.

    Parameters
    ----------
    i : int
        Index of the sensor.
    x, y : float
        Place of the ring now, in the odometry's frame, m.
    neighbours : (n, 2) int
        Indices of each sensor's left and right neighbour; −1 for both without two.
    sensors : (n,) records
        What is remembered of each sensor.
    """
    c = sensors[i]
    if math.hypot(x - c.run_x, y - c.run_y) < SILENT_MIN_M or c.run_length < PASSED_READINGS_MIN:
        return False
    _, _, near_echoes = neighbour_counts(i, neighbours, sensors, False)  # noqa: FBT003 - kernels take no keywords
    return bool(near_echoes >= NEAR_ECHO_SHARE * c.run_length)


@kernel
def count_short_readings(c: SensorMemory, r: float, fired_set: int) -> None:
    """Compare the last reading with `r` and with the one before it, if those were fired in other sets.

    Borenstein & Koren 1995 (EERUF): a true echo does not depend on which other sensors fired.

    Parameters
    ----------
    c : SensorMemory
        The sensor. Its counts of short readings and its crosstalk flags are updated.
    r : float
        The new reading, m.
    fired_set : int
        The set it was fired in.
    """
    middle = c.last_set
    if c.readings < 2 or middle in (fired_set, c.before_last_set):
        return
    if c.last_m < min(r, c.before_last_m) * (1.0 - SHORT_SHARE) - SHORT_M:
        c.short_readings[middle] = min(c.short_readings[middle] + 1.0, 2.0 * SHORT_READINGS_MAX)
    else:
        c.short_readings[middle] = max(c.short_readings[middle] - 2.0, 0.0)
    if c.short_readings[middle] >= SHORT_READINGS_MAX:
        c.is_crossed[middle] = 1
    elif c.short_readings[middle] == 0.0:
        c.is_crossed[middle] = 0


@kernel
def is_doubtful(c: SensorMemory, r: float, x: float, y: float, fired_set: int) -> bool:
    """Return whether a reading is shorter than the last one in another set by more than the base has moved since.

    Parameters
    ----------
    c : SensorMemory
        The sensor, before the reading is entered.
    r : float
        The new reading, m.
    x, y : float
        Place of the ring now, in the odometry's frame, m.
    fired_set : int
        Index of the set that the reading was fired in.
    """
    if c.readings < 1 or c.last_set == fired_set:
        return False
    moved = math.hypot(x - c.last_x, y - c.last_y)
    return bool(r < c.last_m * (1.0 - SHORT_SHARE) - SHORT_M - moved)


@kernel
def update_run_faults(
    i: int, r: float, x: float, y: float, axis: float, half_angle: float, tolerance: float, neighbours: Ints,
    sensors: Records[SensorMemory],
) -> None:  # fmt: skip
    """Set or clear sensor `i`'s faults `STUCK` and `SILENT` from its run of equal readings.

    Parameters
    ----------
    i : int
        The sensor.
    r : float
        Its new reading, m.
    x, y, axis, half_angle, neighbours, sensors
        As for `is_stuck`.
    tolerance : float
        Readings that differ by no more than this are equal, m.
    """
    c = sensors[i]
    if c.faults & STUCK:
        c.off_stuck = 0 if abs(r - c.stuck_m) <= tolerance else c.off_stuck + 1
        if c.off_stuck >= RECOVERY_READINGS:
            c.faults &= ~STUCK
    elif math.isfinite(r):
        c.faults &= ~SILENT
        if is_stuck(i, x, y, axis, half_angle, neighbours, sensors):
            c.faults |= STUCK
            c.stuck_m, c.off_stuck = c.run_m, 0
    elif is_silent(i, x, y, neighbours, sensors):
        c.faults |= SILENT


@kernel
def check_firing(
    ranges: Floats, x: float, y: float, yaw: float, axes: Floats, neighbours: Ints, expected: NDArray[np.bool_],
    half_angle: float, tolerance: float, near: float, sensors: Records[SensorMemory], ring: Records[RingMemory],
    sets: NDArray[np.uint8], trusted: Floats, possible: Floats,
) -> int:  # fmt: skip
    """Test the readings of a firing; return the bits `FAULTS_CHANGED`, `LESS_TRUSTED` and `LESS_POSSIBLE`.

    Parameters
    ----------
    ranges : (n,) float
        As in a `Firing`, m.
    x, y, yaw : float
        Place (m) and direction (rad) of the ring.
    axes : (n,) float
        Direction of each sensor in the ring, rad.
    neighbours : (n, 2) int
        Each sensor's neighbours, −1 for a sensor that has not two.
    expected : (n,) bool
        Whether each sensor fires at all.
    half_angle : float
        Half the beam's width, rad.
    tolerance : float
        Readings that differ by no more than this are equal, m.
    near : float
        Echoes nearer than this are near, m.
    sensors : (n,) records
        What is remembered of each sensor. Updated.
    ring : (1,) record
        What is remembered of the ring. Updated.
    sets : (SETS_MAX, n) uint8
        1 where a sensor belongs to a set. Updated.
    trusted, possible : (n,) float
        Out: the readings that are trusted; those and the doubtful ones, m. NaN for the others.
    """
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
    changed = 0
    for i in range(ranges.shape[0]):
        c = sensors[i]
        if has_leapt:
            c.run_length = 0
        before = c.faults
        r = ranges[i]
        if math.isnan(r):
            c.missed += 1
            if expected[i] and c.missed >= MISSED_FIRINGS_MAX:
                c.faults |= FAILING
            if c.faults != before:
                changed |= FAULTS_CHANGED
            continue
        c.missed = 0
        c.faults &= ~FAILING
        if c.readings > 0 and not (r == c.last_m or abs(r - c.last_m) <= LEAP_M):
            c.counts.leaps += 1
        if r < near:
            c.counts.near_echoes += 1
        if c.run_length == 0 or not (r == c.run_m or abs(r - c.run_m) <= tolerance):
            c.run_firing = ring[0].firings
            c.counts.changes += 1
            begin_run(i, r, x, y, yaw, neighbours, sensors)
        elif abs(yaw - c.run_yaw) > 0.5 * half_angle:
            begin_run(i, c.run_m, x, y, yaw, neighbours, sensors)
        else:
            c.run_length += 1
        update_run_faults(i, r, x, y, yaw + axes[i], half_angle, tolerance, neighbours, sensors)
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
        if c.faults & STUCK or c.is_crossed[fired_set] or (c.faults & SILENT and not math.isfinite(r)):
            trusted[i] = possible[i] = math.nan
            changed |= LESS_TRUSTED | LESS_POSSIBLE
        if c.faults != before:
            changed |= FAULTS_CHANGED
    return changed
