"""Panoramas: the last reading of every sensor, placed in one frame, as a stand of the ring gives them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from config.robot import RingConfig
from drivers.messages import Firing, Pose
from perception.kernel import Floats
from perception.sensor_mounts import mounts_at


@dataclass(frozen=True, slots=True, eq=False)
class Panorama:
    """One reading of each sensor, in the frame of the ring at the last firing."""

    x: Floats
    y: Floats
    axis: Floats
    """(n,): place (m) and direction (rad) of each sensor, in the order of the ring."""
    range_m: Floats
    """(n,): range, m: inf heard nothing, NaN did not fire."""


def panoramas(firings: Sequence[Firing], ring: RingConfig) -> tuple[Panorama, ...]:
    """Return the readings of a stand or of a short drive as panoramas, in the order of time.

    A panorama ends where a sensor fires again. Odometry compounds the firings: all panoramas are in the frame of the
    ring at the last firing, x along its sensor 0.

    Parameters
    ----------
    firings : sequence of Firing
        At least one; poses in odometry's frame.
    ring : RingConfig
        Places of the sensors.
    """
    mounts = np.array(ring.mounts)
    last = Pose(firings[-1].pose.x, firings[-1].pose.y, firings[-1].ring_yaw).inverse()
    done: list[Panorama] = []
    for firing in firings:
        fired = ~np.isnan(firing.ranges_m)
        if not done or (fired & ~np.isnan(done[-1].range_m)).any():
            done.append(Panorama(*np.full((4, len(mounts)), np.nan)))
        at = last.compose(Pose(firing.pose.x, firing.pose.y, firing.ring_yaw))
        cos, sin = math.cos(at.theta), math.sin(at.theta)
        x, y, angle = mounts_at(firing, mounts, ring.turning)[fired].T
        done[-1].x[fired] = at.x + cos * x - sin * y
        done[-1].y[fired] = at.y + sin * x + cos * y
        done[-1].axis[fired] = at.theta + angle
        done[-1].range_m[fired] = firing.ranges_m[fired]
    return tuple(done)


def all_readings(parts: Sequence[Panorama]) -> Panorama:
    """Return the readings of several panoramas in one, without the sensors that did not fire."""
    x, y, axis, range_m = (
        np.concatenate(columns)
        for columns in zip(*((part.x, part.y, part.axis, part.range_m) for part in parts), strict=True)
    )
    fired = ~np.isnan(range_m)
    return Panorama(x[fired], y[fired], axis[fired], range_m[fired])
