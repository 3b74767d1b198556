"""Front end common to all peers: outline segments (McKerrow), in plain numpy.

Two ranges of one sensor from two places have a common tangent, the outline segment. A drum's centre would lie behind
it, one radius along the normal.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.robot import RingConfig
from config.units import FOOT_M
from drivers.messages import Firing, Floats
from runtime.simulation.scenes import DRUM_RADIUS_FT

RADIUS_M: Final = DRUM_RADIUS_FT * FOOT_M
"""Radius of the drums; every peer knows it."""

BASELINE_MIN_M: Final = 0.7 * FOOT_M
BASELINE_MAX_M: Final = 1.1 * FOOT_M
KEPT_READINGS: Final = 4
"""Earlier readings to pair with: a quarter of a foot apart, so up to a foot back."""

Place = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Segment:
    """Outline segment: its ends, m, and the direction of its normal away from the sensor, rad."""

    ends: tuple[Place, Place]
    normal: float


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """Reading of the whole ring, with the segments that it completes.

    `sensors` has shape (n, 3): x, y (m) and direction (rad) in the world. `ranges` has shape (n,), m.
    """

    number: int
    ring: tuple[float, float, float]
    sensors: Floats
    ranges: Floats
    segments: tuple[Segment, ...]


class FrontEnd:
    """Turns firings into readings with segments.

    Parameters
    ----------
    ring
        Geometry of the sensors.
    """

    def __init__(self, ring: RingConfig) -> None:
        self._mounts = np.array(ring.mounts, dtype=np.float64).reshape(-1, 3)
        self._half_angle = math.radians(ring.beam_half_angle_deg)
        self._kept: deque[tuple[Floats, Floats]] = deque(maxlen=KEPT_READINGS)
        self._count = 0

    def take(self, firing: Firing) -> Reading:
        """Return the reading of one firing of the whole ring."""
        c, s = math.cos(firing.ring_yaw), math.sin(firing.ring_yaw)
        x, y, angle = self._mounts.T
        ring = (firing.pose.x, firing.pose.y, firing.ring_yaw)
        sensors = np.column_stack([ring[0] + c * x - s * y, ring[1] + s * x + c * y, ring[2] + angle])
        ranges = firing.ranges_m
        segments = self._segments(sensors, ranges)
        self._kept.appendleft((sensors, ranges))
        self._count += 1
        return Reading(self._count, ring, sensors, ranges, segments)

    def _segments(self, sensors: Floats, ranges: Floats) -> tuple[Segment, ...]:
        """Return the tangents of this reading and the latest one far enough back, sensor by sensor."""
        far_enough = (
            (before, old_ranges, baseline)
            for before, old_ranges in self._kept
            if BASELINE_MIN_M <= (baseline := math.hypot(*(sensors[0, :2] - before[0, :2]))) <= BASELINE_MAX_M
        )
        if (last := next(far_enough, None)) is None:
            return ()
        before, old_ranges, baseline = last
        with np.errstate(invalid="ignore"):
            shorter = old_ranges - ranges
            usable = np.isfinite(shorter) & (np.abs(shorter) <= baseline)
        i = np.flatnonzero(usable)
        along = np.arctan2(sensors[i, 1] - before[i, 1], sensors[i, 0] - before[i, 0])
        opening = np.arccos(shorter[i] / baseline)
        normals = along[:, None] + np.array([-1.0, 1.0]) * opening[:, None]
        off = np.abs((normals - sensors[i, 2][:, None] + math.pi) % (2.0 * math.pi) - math.pi)
        rows = np.arange(len(i))
        side = np.argmin(off, axis=1)
        inside = off[rows, side] <= self._half_angle
        i, normal = i[inside], normals[rows, side][inside]
        n = np.column_stack([np.cos(normal), np.sin(normal)])
        old = (before[i, :2] + old_ranges[i, None] * n).tolist()
        new = (sensors[i, :2] + ranges[i, None] * n).tolist()
        found = zip(old, new, normal.tolist(), strict=True)
        return tuple(Segment(((a[0], a[1]), (b[0], b[1])), direction) for a, b, direction in found)
