"""Outline segments: the paper's second step (§3.2), after McKerrow (1993).

One range only shows that a surface touches an arc. Two ranges of one sensor from two places show more: the common
tangent of both arcs is the best estimate of the surface that returned both echoes.
"""

from __future__ import annotations

import math
from typing import Annotated, Final, TypeAlias

import numpy as np

from config.robot import RingConfig
from config.settings import SegmentsConfig
from drivers.messages import Firing
from perception.bounds import CONSTANT, RANGE, Place, bounds, index_of, up_to
from perception.kernel import Floats, kernel
from perception.paper.parameters import READING_SPACING, SENSOR_READINGS_KEPT
from perception.records import Record, Records, records, zeros
from perception.sensor_mounts import RingPose, mounts_array, mounts_at, ring_pose, sensor_pose


class KeptReading(Record):
    """A range and where it was measured."""

    x: Place
    """Place of the sensor, m."""
    y: Place
    axis: Place
    """Direction of its axis, rad."""
    range_m: Annotated[float, RANGE]
    robot_s: Place


class SensorReadings(Record):
    """The last readings of a sensor, a ring buffer."""

    newest: Annotated[int, index_of(SENSOR_READINGS_KEPT)]
    """Index of the newest reading."""
    count: Annotated[int, up_to(SENSOR_READINGS_KEPT)]
    """Readings kept."""
    kept: Annotated[Records[KeptReading], SENSOR_READINGS_KEPT]


@kernel
def tangent(
    x1: float, y1: float, axis1: float, r1: float, x2: float, y2: float, axis2: float, r2: float, half_angle: float
) -> tuple[bool, float]:
    """Return the normal of the common tangent of two readings' arcs.

    A line n·x = c touches both circles where n·P1 + r1 = n·P2 + r2 = c, so that cos(α − φ) = (r1 − r2)/L for the
    direction α of n, with L and φ the length and direction of P2 − P1 (McKerrow 1993; paper §3.2, Figure 2).

    Parameters
    ----------
    x1, y1, axis1, r1 : float
        First reading: place of the sensor (m), direction of its axis (rad), range (m).
    x2, y2, axis2, r2 : float
        Second reading.
    half_angle : float
        Half the beam's width, rad: the arcs end there.

    Returns
    -------
    (bool, float)
        Whether a tangent touches both arcs inside both beams, and the direction of its normal, from the sensors
        to the surface (rad). If both roots do, the one nearer to the axes.
    """
    baseline = math.hypot(x2 - x1, y2 - y1)
    if baseline == 0.0 or abs(r1 - r2) > baseline:
        return False, 0.0
    phi = math.atan2(y2 - y1, x2 - x1)
    opening = math.atan2(math.sqrt((baseline - (r1 - r2)) * (baseline + (r1 - r2))), r1 - r2)
    found = False
    best = math.inf
    normal = 0.0
    for side in (-1.0, 1.0):
        alpha = phi + side * opening
        off1 = abs((alpha - axis1 + math.pi) % (2.0 * math.pi) - math.pi)
        off2 = abs((alpha - axis2 + math.pi) % (2.0 * math.pi) - math.pi)
        if off1 <= half_angle and off2 <= half_angle and off1 * off1 + off2 * off2 < best:
            found = True
            best = off1 * off1 + off2 * off2
            normal = alpha
    return found, normal


Apart: TypeAlias = tuple[float, float, float, float]
"""Least and greatest distance between the two readings of a pair (m), the longest time between them (s), and the
least distance between kept readings (m)."""


@kernel
def pair_readings(
    ranges: Floats,
    mounts: Floats,
    pose: RingPose,
    t: float,
    sensors: Records[SensorReadings],
    half_angle: float,
    apart: Apart,
    out: Floats,
) -> int:
    """Pair each echo of a firing with the last kept one far enough back; return the number of segments.

    Parameters
    ----------
    ranges : (n,) float
        As in a `Firing`, m: NaN did not fire, inf heard nothing. Neither is paired.
    mounts : (n, 3) float
        x, y (m) and direction (rad) of each sensor in the ring's frame.
    pose : RingPose
        Place of the ring (m) and direction of its sensor 0 (rad).
    t : float
        Time of the firing, s.
    sensors : (n,) records
        Each sensor's last readings. Updated.
    half_angle : float
        Half the beam's width, rad.
    apart : Apart
        How far apart readings are that are paired.
    out : (n, 5) float
        Out: the segments' end points x1, y1, x2, y2 (m) and direction of the normal (rad).

    Returns
    -------
    int
        How many segments were written to `out`.
    """
    baseline_min, baseline_max, gap_max, spacing = apart
    count = 0
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if not math.isfinite(r):
            continue
        x, y, axis = sensor_pose(mounts, i, pose)
        sensor = sensors[i]
        if sensor.count > 0:
            last = sensor.kept[sensor.newest]
            if t - last.robot_s <= gap_max and math.hypot(x - last.x, y - last.y) < spacing:
                continue
        for back in range(sensor.count):
            old = sensor.kept[(sensor.newest - back) % SENSOR_READINGS_KEPT]
            if t - old.robot_s > gap_max:
                break
            baseline = math.hypot(x - old.x, y - old.y)
            if baseline < baseline_min:
                continue
            if baseline <= baseline_max:
                found, normal = tangent(old.x, old.y, old.axis, old.range_m, x, y, axis, r, half_angle)
                if found:
                    nx = math.cos(normal)
                    ny = math.sin(normal)
                    out[count, 0] = old.x + old.range_m * nx
                    out[count, 1] = old.y + old.range_m * ny
                    out[count, 2] = x + r * nx
                    out[count, 3] = y + r * ny
                    out[count, 4] = normal
                    count += 1
            break
        sensor.newest = (sensor.newest + 1) % SENSOR_READINGS_KEPT
        sensor.count = min(sensor.count + 1, SENSOR_READINGS_KEPT)
        new = sensor.kept[sensor.newest]
        new.x, new.y, new.axis, new.range_m, new.robot_s = x, y, axis, r, t
    return count


class SegmentExtractor:
    """Turns firings into outline segments; keeps each sensor's last readings.

    Parameters
    ----------
    ring : RingConfig
        Mounts and beam width of the sensors.
    config : SegmentsConfig
        Which readings are paired.
    """

    SCRATCH: Final = ("_out", "_sensor_records")
    """Not part of a snapshot: overwritten before each use, or a view of arrays that are."""
    BOUNDS: Final = bounds(_mounts=CONSTANT, _half_angle=CONSTANT, _sensors=SensorReadings.BOUNDS)

    def __init__(self, ring: RingConfig, config: SegmentsConfig) -> None:
        count = len(ring.mounts)
        self._mounts, self._turning = mounts_array(ring.mounts), ring.turning
        self._half_angle = math.radians(ring.beam_half_angle_deg)
        self._config = config
        self._sensors = zeros(SensorReadings, count)
        self._sensor_records = records(SensorReadings, self._sensors)
        self._out = np.zeros((count, 5))

    def extract(self, firing: Firing) -> Floats:
        """Return the segments that `firing` completes: a view of shape (m, 5), valid until the next call.

        A row holds the end points x1, y1, x2, y2 (m) and the direction of the normal, away from the sensor (rad).
        """
        config = self._config
        count = pair_readings(
            firing.ranges_m,
            mounts_at(firing, self._mounts, self._turning),
            ring_pose(firing),
            float(firing.robot_s),
            self._sensor_records,
            self._half_angle,
            (
                config.baseline_min_m,
                config.baseline_max_m,
                config.gap_max_s,
                READING_SPACING * config.baseline_min_m,
            ),
            self._out,
        )
        return self._out[:count]

    def apply_settings(self, config: SegmentsConfig) -> None:
        """Pair readings by other settings from now on."""
        self._config = config

    def reset(self) -> None:
        """Discard all readings, as after a reset of the odometry."""
        self._sensors["count"] = 0
