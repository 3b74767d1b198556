"""What exports for three-dimensional viewers share: turned frames, scans of a firing, outlines of objects."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.robot import RingConfig
from drivers.messages import Floats
from runtime.analysis.timeline import BEARING, RANGE, ROBOT_T, SENSOR, T, Timeline, X, Y

HEIGHT_M = 0.9
"""Of what is drawn upright: a drum's."""
EVEN_M = 1e-6

Colour = tuple[float, float, float]
SEGMENT: Final = (0.84, 0.37, 0.0)
CLUSTER: Final = (0.0, 0.62, 0.45)
MODEL: Final = (0.0, 0.45, 0.70)
TRUTH: Final = (0.6, 0.6, 0.6)
"""Red, green and blue of what is drawn, from 0 to 1; close to the pictures' own, see `drawing.style`."""

Quarter = tuple[float, float, float, float]


def turned(yaw: float) -> Quarter:
    """Return a turn about the vertical as a quaternion x, y, z, w."""
    return (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))


@dataclass(frozen=True, slots=True, eq=False)
class Round:
    """The readings of one firing."""

    t_s: float
    x: float
    y: float
    yaw: float
    """Where the ring was, and its direction."""
    rows: Floats
    """Of `Timeline.echoes`."""


def rounds(timeline: Timeline) -> Iterator[Round]:
    """Yield the firings of a run, each with where the ring was, worked out from its sensors' places."""
    rows, mounts = timeline.echoes, timeline.settings.ring.mounts
    if not len(rows):
        return
    cuts = np.flatnonzero((np.diff(rows[:, ROBOT_T]) != 0.0) | (np.diff(rows[:, T]) != 0.0)) + 1
    for part in np.split(rows, cuts):
        first = part[0]
        mx, my, angle = mounts[int(first[SENSOR])]
        yaw = float(first[BEARING]) - angle
        c, s = math.cos(yaw), math.sin(yaw)
        yield Round(
            float(first[T]), float(first[X]) - c * mx + s * my, float(first[Y]) - s * mx - c * my, yaw, part
        )  # fmt: skip


def even_radius(ring: RingConfig) -> float | None:
    """Return the radius of a ring whose sensors stand evenly on a circle and look outwards, else None."""
    mounts = ring.mounts
    radius = math.hypot(mounts[0][0], mounts[0][1])
    step = 2.0 * math.pi / len(mounts)
    for i, (x, y, angle) in enumerate(mounts):
        at = (radius * math.cos(i * step), radius * math.sin(i * step))
        if math.dist((x, y), at) > EVEN_M or abs(math.remainder(angle - i * step, 2.0 * math.pi)) > EVEN_M:
            return None
    return radius


def whole_ring(sensors: int, radius: float, part: Round) -> list[float]:
    """Return a firing's ranges from the ring's centre, one a sensor; NaN did not fire."""
    ranges = np.full(sensors, np.nan)
    ranges[part.rows[:, SENSOR].astype(int)] = part.rows[:, RANGE] + radius
    told: list[float] = ranges.tolist()
    return told
