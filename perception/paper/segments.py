"""Outline segments: the paper's second step (§3.2), after McKerrow.

One range says only that a surface touches an arc. Two ranges of one sensor from two places say more: the common
tangent of both arcs is the best estimate of the surface that answered both.
"""

from __future__ import annotations

import math

import numpy as np

from config.robot import RingConfig
from config.settings import SegmentsConfig
from drivers.messages import Firing
from perception.kernel import Floats, Ints, kernel
from perception.sensor_mounts import mounts_array

REMEMBERED = 16
"""Readings kept of each sensor; they lie a fraction of a baseline apart, so this spans several baselines."""

SPACING = 0.25
"""A reading is kept once its sensor has moved this share of the shortest baseline since the last one kept."""


@kernel
def tangent(
    x1: float, y1: float, axis1: float, r1: float, x2: float, y2: float, axis2: float, r2: float, half_angle: float
) -> tuple[bool, float]:
    """Return the direction of the normal of the line that touches both ranges' arcs.

    A line n·x = c touches both circles where n·P1 + r1 = n·P2 + r2 = c, so that cos(α − φ) = (r1 − r2)/L for the
    direction α of n, with L and φ the length and direction of P2 − P1 (McKerrow 1993; paper §3.2, Figure 2).

    Parameters
    ----------
    x1, y1, axis1, r1 : float
        First reading: the sensor's place (m), the direction of its axis (rad), its range (m).
    x2, y2, axis2, r2 : float
        Second reading.
    half_angle : float
        Half the beam's opening, rad: the arcs end there.

    Returns
    -------
    (bool, float)
        Whether a tangent touches both arcs inside both beams, and the direction of its normal, from the sensors
        to the surface (rad). Where both roots do, the one nearer to the axes.
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


@kernel
def pair_readings(
    ranges: Floats,
    mounts: Floats,
    pose_x: float,
    pose_y: float,
    yaw: float,
    t: float,
    kept: Floats,
    newest: Ints,
    filled: Ints,
    half_angle: float,
    baseline_min: float,
    baseline_max: float,
    gap_max: float,
    spacing: float,
    out: Floats,
) -> int:
    """Pair each new reading of a firing with the last one far enough back, and remember it.

    Parameters
    ----------
    ranges : (n,) float
        Metres; NaN did not fire, inf heard nothing. Neither is an echo and neither is paired.
    mounts : (n, 3) float
        x, y (m) and direction (rad) of each sensor in the ring's frame.
    pose_x, pose_y, yaw, t : float
        Place of the ring (m), direction of its sensor 0 (rad), time of the firing (s).
    kept : (n, k, 5) float
        Circular memory of each sensor's readings: x, y, axis, range, time. Updated.
    newest, filled : (n,) int
        Index of each sensor's newest kept reading and how many are kept. Updated.
    half_angle, baseline_min, baseline_max, gap_max, spacing : float
        Radians, metres, metres, seconds, metres.
    out : (n, 5) float
        Room for the segments: both ends x, y, x, y (m) and the direction of the normal (rad).

    Returns
    -------
    int
        How many segments were written to `out`.
    """
    count = 0
    memory = kept.shape[1]
    c = math.cos(yaw)
    s = math.sin(yaw)
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if not math.isfinite(r):
            continue
        x = pose_x + c * mounts[i, 0] - s * mounts[i, 1]
        y = pose_y + s * mounts[i, 0] + c * mounts[i, 1]
        axis = yaw + mounts[i, 2]
        if filled[i] > 0:
            last = kept[i, newest[i]]
            if t - last[4] <= gap_max and math.hypot(x - last[0], y - last[1]) < spacing:
                continue
        for back in range(filled[i]):
            old = kept[i, (newest[i] - back) % memory]
            if t - old[4] > gap_max:
                break
            baseline = math.hypot(x - old[0], y - old[1])
            if baseline < baseline_min:
                continue
            if baseline <= baseline_max:
                found, normal = tangent(old[0], old[1], old[2], old[3], x, y, axis, r, half_angle)
                if found:
                    nx = math.cos(normal)
                    ny = math.sin(normal)
                    out[count, 0] = old[0] + old[3] * nx
                    out[count, 1] = old[1] + old[3] * ny
                    out[count, 2] = x + r * nx
                    out[count, 3] = y + r * ny
                    out[count, 4] = normal
                    count += 1
            break
        newest[i] = (newest[i] + 1) % memory
        filled[i] = min(filled[i] + 1, memory)
        kept[i, newest[i], 0] = x
        kept[i, newest[i], 1] = y
        kept[i, newest[i], 2] = axis
        kept[i, newest[i], 3] = r
        kept[i, newest[i], 4] = t
    return count


class SegmentExtractor:
    """Firings in, outline segments out; remembers each sensor's last readings.

    Parameters
    ----------
    ring : RingConfig
        Where the sensors sit and how wide their beams are.
    config : SegmentsConfig
        Which pairs are made.
    """

    def __init__(self, ring: RingConfig, config: SegmentsConfig) -> None:
        sensors = len(ring.mounts)
        self._mounts = mounts_array(ring.mounts)
        self._half_angle = math.radians(ring.beam_half_angle_deg)
        self._config = config
        self._kept = np.zeros((sensors, REMEMBERED, 5))
        self._newest = np.zeros(sensors, dtype=np.int64)
        self._filled = np.zeros(sensors, dtype=np.int64)
        self._out = np.zeros((sensors, 5))

    def extract(self, firing: Firing) -> Floats:
        """Return the segments that `firing` completes: a view of shape (m, 5), valid until the next call.

        A row is both ends x, y, x, y (m) and the direction of the normal, away from the sensor (rad).
        """
        config = self._config
        count = pair_readings(
            firing.ranges_m, self._mounts, firing.pose.x, firing.pose.y, firing.ring_yaw, firing.robot_s,
            self._kept, self._newest, self._filled, self._half_angle,
            config.baseline_min_m, config.baseline_max_m, config.gap_max_s, SPACING * config.baseline_min_m,
            self._out,
        )  # fmt: skip
        return self._out[:count]

    def apply_settings(self, config: SegmentsConfig) -> None:
        """Make pairs of other readings from now on."""
        self._config = config

    def reset(self) -> None:
        """Forget all readings, as after the odometry began anew."""
        self._filled[:] = 0
