"""The mounts of the ring's sensors as an array, as the kernels take them, and how far the ring reaches.

A ring has one direction. Sensors of a part that turns otherwise, as the upper ring of a B21r does with the wheels,
have mounts that turn in the ring's frame, by the angle between the direction of travel and the ring's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from config.robot import RingConfig
from drivers.messages import Firing
from perception.kernel import Floats, kernel

RingPose: TypeAlias = tuple[float, float, float]
"""Place x, y (m) and direction (rad) of a ring in the odometry's frame, as kernels take it."""
SensorPose: TypeAlias = tuple[float, float, float]
"""The same of a sensor."""


@kernel
def sensor_pose(mounts: Floats, i: int, pose: RingPose) -> SensorPose:
    """Return where sensor `i` of a ring is, and its direction; `mounts` as of `mounts_array`."""
    x, y, yaw = pose
    c, s = math.cos(yaw), math.sin(yaw)
    return x + c * mounts[i, 0] - s * mounts[i, 1], y + s * mounts[i, 0] + c * mounts[i, 1], yaw + mounts[i, 2]


def ring_pose(firing: Firing) -> RingPose:
    """Return where the ring was at a firing, and its direction."""
    return float(firing.pose.x), float(firing.pose.y), float(firing.ring_yaw)


def mounts_array(mounts: Sequence[tuple[float, float, float]]) -> Floats:
    """Return the mounts of all sensors in the ring's frame, shape (n, 3): x, y (m), direction (rad)."""
    return np.array(mounts, dtype=np.float64).reshape(len(mounts), 3)


def farthest_m(mounts: Sequence[tuple[float, float, float]]) -> float:
    """Return how far the farthest sensor is from the ring's centre, m."""
    return max(math.hypot(x, y) for x, y, _ in mounts)


def turned_mounts(mounts: Floats, turning: tuple[int, ...], turn: float) -> Floats:
    """Return the mounts with those of some sensors turned about the ring's centre; the same array if there are none.

    Parameters
    ----------
    mounts : (n, 3) float
        x, y (m), direction (rad) of each sensor.
    turning : tuple of int
        The sensors that turn.
    turn : float
        By how much, rad: direction of travel less that of the ring.
    """
    if not turning:
        return mounts
    rows, turned = list(turning), mounts.copy()
    x, y, axis = mounts[rows].T
    c, s = math.cos(turn), math.sin(turn)
    turned[rows] = np.column_stack([c * x - s * y, s * x + c * y, axis + turn])
    return turned


@kernel
def turn_mounts(mounts: Floats, turning: NDArray[np.bool_], turn: float, turned: Floats) -> None:
    """Turn the mounts of some sensors about the ring's centre, as `turned_mounts` without a new array.

    Parameters
    ----------
    mounts : (n, 3) float
        x, y (m), direction (rad) of each sensor.
    turning : (n,) bool
        Whether each sensor turns.
    turn : float
        By how much, rad.
    turned : (n, 3) float
        The mounts after the turn. Overwritten.
    """
    c, s = math.cos(turn), math.sin(turn)
    for i in range(len(mounts)):
        x, y, axis = mounts[i]
        turned[i, 0], turned[i, 1], turned[i, 2] = x, y, axis
        if turning[i]:
            turned[i, 0], turned[i, 1], turned[i, 2] = c * x - s * y, s * x + c * y, axis + turn


def mounts_at(firing: Firing, mounts: Floats, turning: tuple[int, ...]) -> Floats:
    """Return the mounts in the ring's frame at a firing, as `turned_mounts`."""
    return turned_mounts(mounts, turning, firing.pose.theta - firing.ring_yaw)


def reach_m(ring: RingConfig) -> float:
    """Return the distance from the ring's centre to which every sensor without an echo shows free space, m."""
    return ring.window_m + min(m.x_m * math.cos(m.angle_rad) + m.y_m * math.sin(m.angle_rad) for m in ring.mounts)
