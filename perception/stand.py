"""The surfaces around a robot that stands: kind, place and bearing of each, from times of flight at one place alone.

`perception.echo_kind` takes the readings of one surface; here they are found. The nearest own echo that belongs
to no surface yet begins one, and every path that ends on it, echo or cross path, is taken with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.robot import RingConfig
from drivers.messages import Firing, Pose
from perception.constant_depth import constant_depths
from perception.echo_kind import EchoKind, echo_kind
from perception.kernel import Floats
from perception.sensor_mounts import mounts_array, mounts_at

STAND_STILL_M: Final = 2e-3
"""A robot whose odometry shifts by less than this, and turns by less than `STILL_RAD`, stands."""
STILL_RAD: Final = math.radians(0.2)
"""Turn in `STAND_STILL_M`."""
HALF_PATH_GATE_M: Final = 0.06
"""Half paths that differ by more from those over the surface's nearest point are of another surface. A wall's differ
by 4 cm at the shortest range and the longest baseline."""
NEAR_RAD: Final = math.radians(24.0)
"""Transmitters that look farther off a surface's direction are left out."""
UNKNOWN_NOISE_M: Final = 1e-3
"""Standard deviation of a range where no path was heard often enough to know it."""
REPEATS_MIN: Final = 3
"""Readings of a path from which on they show the noise."""
ONE_SURFACE_MISFIT_MAX: Final = 9.0
"""Mean square of the residuals, in their variance, above which the readings are not those of one surface."""


class StandSurface(NamedTuple):
    """A surface heard from a stand."""

    echo: EchoKind
    """In the ring's frame."""
    paths: int
    """Echoes and cross paths of different sensors that it rests on."""

    @property
    def is_one(self) -> bool:
        """Whether the readings fit one surface; the odds mean nothing otherwise."""
        return self.echo.misfit <= ONE_SURFACE_MISFIT_MAX

    @property
    def kind(self) -> str:
        """As `EchoKind.kind`, but `unknown` where the readings do not fit one surface."""
        return self.echo.kind if self.is_one else "unknown"

    def place(self, ring: Pose) -> tuple[float, float]:
        """Return its nearest point, of a corner the vertex, in the frame of the ring's pose, m."""
        at = ring.theta + self.echo.bearing
        return ring.x + self.echo.range_m * math.cos(at), ring.y + self.echo.range_m * math.sin(at)


def stand_of(firings: Sequence[Firing], robot_s: float = math.inf) -> Sequence[Firing]:
    """Return the firings at the place where the robot was at a time by its own clock; none if there was none before.

    Parameters
    ----------
    firings : sequence of Firing
        In order of time.
    robot_s : float
        s; by default the end.
    """
    last = next((i for i in reversed(range(len(firings))) if firings[i].robot_s <= robot_s), None)
    if last is None:
        return ()
    first, end = last, last + 1
    while first > 0 and _is_still(firings[first - 1], firings[last]):
        first -= 1
    while end < len(firings) and _is_still(firings[end], firings[last]):
        end += 1
    return firings[first:end]


def last_round(stand: Sequence[Firing]) -> Sequence[Firing]:
    """Return the last firings of a stand in which no sensor fires twice.

    What a surface answers from one place is the same in each round: rounds that are repeated add no evidence.
    """
    fired = np.zeros(len(stand[-1].ranges_m) if stand else 0, dtype=np.bool_)
    first = len(stand)
    while first > 0 and not (fired & ~np.isnan(stand[first - 1].ranges_m)).any():
        first -= 1
        fired |= ~np.isnan(stand[first].ranges_m)
    return stand[first:]


def _is_still(one: Firing, other: Firing) -> bool:
    turned = max(abs(one.ring_yaw - other.ring_yaw), abs(one.pose.theta - other.pose.theta))
    return math.dist((one.pose.x, one.pose.y), (other.pose.x, other.pose.y)) < STAND_STILL_M and turned < STILL_RAD


def surfaces_of_stand(ring: RingConfig, firings: Sequence[Firing]) -> tuple[StandSurface, ...]:
    """Return the surfaces that were heard over at least three different paths from one place, the nearest first.

    Those of a ring with servos are its regions of constant depth.

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    firings : sequence of Firing
        Of one stand, as of `stand_of`.
    """
    if not firings:
        return ()
    if ring.has_servo:
        surfaces = (StandSurface(*one) for one in constant_depths(ring, firings))
        return tuple(sorted(surfaces, key=lambda one: one.echo.range_m))
    mounts = mounts_at(firings[-1], mounts_array(ring.mounts), ring.turning)
    readings, noise_m = _without_outliers(_heard(firings))
    left, found = np.ones(len(readings), dtype=np.bool_), list[StandSurface]()
    while (own := left & (readings[:, 0] == readings[:, 1])).any():
        start = int(np.flatnonzero(own)[np.argmin(readings[own, 2])])
        sensor = int(readings[start, 0])
        bearing = float(mounts[sensor, 2])
        range_m = float(readings[start, 2] + math.hypot(mounts[sensor, 0], mounts[sensor, 1]))
        left[start] = False
        surface, taken = None, left  # echo_kind's answer, and which readings it rests on
        for _ in range(2):  # first about the sensor's axis, then about the direction found
            taken = _on_surface(readings, mounts, bearing, range_m, ring.resolution_m)
            of = readings[taken]
            transmitters, listeners = (mounts[of[:, k].astype(np.int64), :2] for k in (0, 1))
            surface = echo_kind(transmitters, listeners, of[:, 2], noise_m, ring.resolution_m)
            if surface is None:
                break
            bearing, range_m = surface.bearing, surface.range_m
        if surface is not None:
            # One that lives of the paths of others is a mixture of two surfaces as far away.
            if left[taken].sum() + 1 > 0.5 * taken.sum():
                found.append(StandSurface(surface, len(np.unique(readings[taken, :2], axis=0))))
            left[taken] = False
    return tuple(sorted(found, key=lambda one: one.echo.range_m))


def _heard(firings: Sequence[Firing]) -> Floats:
    """Return every echo and cross path: transmitter, listener, half path (m); shape (n, 3)."""
    rows: list[tuple[float, float, float]] = []
    for firing in firings:
        rows += [(i, i, r) for i, r in enumerate(firing.ranges_m.tolist()) if math.isfinite(r)]
        if (crosses := firing.cross_paths) is not None:
            columns = (crosses.transmitters, crosses.listeners, crosses.half_paths_m)
            rows += [row for row in zip(*(c.tolist() for c in columns), strict=True) if math.isfinite(row[2])]
    return np.array(rows, dtype=np.float64).reshape(-1, 3)


def _without_outliers(readings: Floats) -> tuple[Floats, float]:
    """Return the readings without those far from the median of their path, and the noise of a single one, m.

    Readings are rows as of `_heard`. The noise is one standard deviation for all paths, from those heard
    `REPEATS_MIN` times or more. Far is beyond five of it, but never closer than half of `HALF_PATH_GATE_M`.
    """
    _, path = np.unique(readings[:, :2], axis=0, return_inverse=True)
    path = path.ravel()
    middle = np.array([np.median(readings[path == k, 2]) for k in range(path.max(initial=-1) + 1)])
    off = np.abs(readings[:, 2] - middle[path]) if len(readings) else np.zeros(0)
    often = np.bincount(path)[path] >= REPEATS_MIN if len(readings) else np.zeros(0, dtype=np.bool_)
    # 1.4826: a normal distribution's standard deviation, in medians of the distance from its middle.
    noise_m = max(UNKNOWN_NOISE_M, 1.4826 * float(np.median(off[often]))) if often.any() else UNKNOWN_NOISE_M
    return readings[off <= max(5.0 * noise_m, 0.5 * HALF_PATH_GATE_M)], noise_m


def _on_surface(
    readings: Floats, mounts: Floats, bearing: float, range_m: float, resolution_m: float
) -> NDArray[np.bool_]:
    """Return which readings end on the surface whose nearest point lies in this direction at this range."""
    point = range_m * np.array([math.cos(bearing), math.sin(bearing)])
    transmitters, listeners = (readings[:, k].astype(np.int64) for k in (0, 1))
    way = [np.hypot(*(mounts[at, :2] - point).T) for at in (transmitters, listeners)]
    off = np.abs(np.angle(np.exp(1j * (mounts[transmitters, 2] - bearing))))
    beside = np.abs(0.5 * (way[0] + way[1]) - readings[:, 2])
    return np.asarray((beside <= HALF_PATH_GATE_M + resolution_m) & (off <= NEAR_RAD))
