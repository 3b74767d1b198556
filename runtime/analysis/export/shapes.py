"""Functions common to exports for 3D viewers: quaternions, colours, and the scan of each firing."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.robot import RingConfig
from drivers.messages import Floats, Pose
from runtime.analysis.plots.geometry import world_outlines
from runtime.analysis.timeline import Echoes, Timeline

HEIGHT_M = 0.9
"""Height of what is drawn upright, m: that of a drum."""
EVEN_M = 1e-6
"""Tolerance for the positions of sensors on an even ring, m and rad."""

Colour = tuple[float, float, float]
SEGMENT: Final = (0.84, 0.37, 0.0)
CROSS: Final = (0.34, 0.39, 0.0)
CLUSTER: Final = (0.0, 0.62, 0.45)
MODEL: Final = (0.0, 0.45, 0.70)
TRUTH: Final = (0.6, 0.6, 0.6)
"""Red, green and blue, from 0 to 1; close to the colours of the figures, see `runtime.analysis.plots.plot_style`."""

Quaternion = tuple[float, float, float, float]
Points = list[tuple[float, float]]


def yaw_quaternion(yaw: float) -> Quaternion:
    """Return a rotation by `yaw` (rad) about the vertical as a quaternion x, y, z, w."""
    return (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))


@dataclass(frozen=True, slots=True, eq=False)
class FiringScan:
    """The readings of one firing."""

    t_s: float
    x: float
    y: float
    yaw: float
    """Pose of the ring."""
    rows: Echoes
    """Its part of `Timeline.echoes`."""


def firing_scans(timeline: Timeline) -> Iterator[FiringScan]:
    """Yield the firings of a run, each with the pose of the ring, computed from the positions of its sensors."""
    yield from scans_of(timeline.echoes, timeline.settings.ring)


def scans_of(rows: Echoes, ring: RingConfig) -> Iterator[FiringScan]:
    """Yield the firings of some readings; see `firing_scans`."""
    mounts, turning = ring.mounts, frozenset(ring.turning)
    if not len(rows):
        return
    cuts = np.flatnonzero((np.diff(rows["robot_s"]) != 0.0) | (np.diff(rows["t_s"]) != 0.0)) + 1
    for part in np.split(rows, cuts):
        first = next((row for row in part if int(row["sensor"]) not in turning), part[0])
        mx, my, angle = mounts[int(first["sensor"])]
        yaw = float(first["bearing"]) - angle
        c, s = math.cos(yaw), math.sin(yaw)
        yield FiringScan(
            float(first["t_s"]), float(first["x"]) - c * mx + s * my, float(first["y"]) - s * mx - c * my, yaw, part
        )


def truth_outlines(timeline: Timeline) -> tuple[list[Points], list[Points]]:
    """Return the true world in odometry's frame: closed outlines and lines, m; nothing if it is not known."""
    if timeline.world is None:
        return [], []
    start = timeline.start.inverse()

    def moved(rows: Iterable[Floats]) -> list[Points]:
        places = [[start.compose(Pose(x, y, 0.0)) for x, y in row.tolist()] for row in rows]
        return [[(place.x, place.y) for place in row] for row in places]

    closed, lines = world_outlines(timeline.world)
    return moved(closed), moved(lines)


def even_radius(mounts: Sequence[Sequence[float]]) -> float | None:
    """Return the radius of a ring whose sensors are evenly spaced on a circle and point outwards; None otherwise."""
    radius = math.hypot(mounts[0][0], mounts[0][1])
    step = 2.0 * math.pi / len(mounts)
    for i, (x, y, angle) in enumerate(mounts):
        at = (radius * math.cos(i * step), radius * math.sin(i * step))
        if math.dist((x, y), at) > EVEN_M or abs(math.remainder(angle - i * step, 2.0 * math.pi)) > EVEN_M:
            return None
    return radius


def whole_ring(sensors: int, radius: float, scan: FiringScan) -> list[float]:
    """Return a firing's ranges from the ring's centre, one for each sensor; NaN if it did not fire.

    `radius` is that of the ring, m.
    """
    ranges = np.full(sensors, np.nan)
    ranges[scan.rows["sensor"].astype(int)] = scan.rows["range_m"] + radius
    ranges_list: list[float] = ranges.tolist()
    return ranges_list
