"""A recorded drive, and its path under other scales of the odometry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from drivers.messages import Firing
from perception.kernel import Floats

KNOT_M: Final = 0.5
"""Way between two knots, at which the heading may bend by what the odometry has missed, m."""


class Scales(NamedTuple):
    """What odometry and ranges multiply the truth by."""

    distance: float = 1.0
    """Distance that the odometry reports, over the true one."""
    turn: float = 1.0
    """Turn that the odometry reports, over the true one."""
    range: float = 1.0
    """Range that the ring reports, over the true one."""


class Path(NamedTuple):
    """Poses of the ring, one a firing."""

    xy: Floats
    """Places of its centre, m, shape (f, 2)."""
    yaw: Floats
    """Its directions, rad, shape (f,)."""


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """The firings of a drive, as the robot reported them."""

    poses: Floats
    """(f, 3): place (m) and heading (rad, unwrapped) by the odometry."""
    ring_yaw: Floats
    """(f,): direction of the ring by the odometry, rad."""
    ranges: Floats
    """(f, n): range of each sensor, m; inf for silence, NaN if it did not fire."""
    way_m: Floats
    """(f,): way to each firing by the odometry, m."""
    chords_m: Floats
    """(f - 1,): distance from each pose to the next, m."""
    sideways: Floats
    """(f - 1,): direction of that chord from the heading half-way: 0 forwards, π backwards, rad."""

    @property
    def knots(self) -> int:
        """Number of knots of the path."""
        return int(self.way_m[-1] // KNOT_M)

    def path(self, scales: Scales, bends: Floats, *, synchro: bool) -> Path:
        """Return the true path under these errors of the odometry; it begins at the first reported pose.

        Parameters
        ----------
        scales : Scales
            Those of distance and turn count.
        bends : (knots,) float
            Turn that the odometry has missed between a knot and the one before, rad.
        synchro : bool
            The ring does not turn with the wheels.
        """
        x, y, reported = self.poses.T
        missed = np.interp(self.way_m, KNOT_M * np.arange(len(bends) + 1), np.concatenate([[0.0], np.cumsum(bends)]))
        heading = reported[0] + (reported - reported[0]) / scales.turn + missed
        direction = 0.5 * (heading[:-1] + heading[1:]) + self.sideways
        chord = self.chords_m / scales.distance
        xy = np.empty((len(x), 2))
        xy[0] = x[0], y[0]
        xy[1:, 0] = x[0] + np.cumsum(chord * np.cos(direction))
        xy[1:, 1] = y[0] + np.cumsum(chord * np.sin(direction))
        return Path(xy, self.ring_yaw.copy() if synchro else self.ring_yaw - reported + heading)


def drive_of(firings: Sequence[Firing], range_min_m: float) -> Drive:
    """Return the drive of these firings, at least two.

    Parameters
    ----------
    firings
        Oldest first.
    range_min_m
        Ranges up to here are left out: a surface may be nearer than the least range.
    """
    poses = np.array([(firing.pose.x, firing.pose.y, firing.pose.theta) for firing in firings])
    poses[:, 2] = np.unwrap(poses[:, 2])
    yaw = np.unwrap(np.array([firing.ring_yaw for firing in firings]))
    ranges = np.array([firing.ranges_m for firing in firings])
    ranges[ranges <= range_min_m] = np.nan
    dx, dy = np.diff(poses[:, :2], axis=0).T
    chords = np.hypot(dx, dy)
    # A step is the chord of an arc: it points where the robot headed half-way.
    sideways = np.arctan2(dy, dx) - 0.5 * (poses[:-1, 2] + poses[1:, 2])
    return Drive(poses, yaw, ranges, np.concatenate([[0.0], np.cumsum(chords)]), chords, sideways)
