"""What any robot says and hears, whatever its wire format.

These types are the door between drivers/ and everything above it: a further robot is one more folder that
produces them, and nothing else changes. Everything is SI and radians; counter-clockwise is positive, x forward.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntFlag
from typing import Annotated, TypeAlias

import numpy as np
from numpy.typing import NDArray

from drivers.json_array import NumberList

Floats: TypeAlias = Annotated[NDArray[np.float64], NumberList()]


def wrap_angle(angle_rad: float) -> float:
    """Return `angle_rad` brought into [−π, π)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


@dataclass(frozen=True, slots=True)
class Pose:
    """A place and direction in the plane: metres and radians, an element of SE(2)."""

    x: float
    y: float
    theta: float

    def compose(self, other: Pose) -> Pose:
        """Return `other`, given in this pose's frame, in the frame this pose is given in."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose(self.x + c * other.x - s * other.y, self.y + s * other.x + c * other.y, self.theta + other.theta)

    def inverse(self) -> Pose:
        """Return the pose p with ``p.compose(self)`` the identity."""
        c, s = math.cos(self.theta), math.sin(self.theta)
        return Pose(-c * self.x - s * self.y, s * self.x - c * self.y, -self.theta)


@dataclass(frozen=True, slots=True)
class Twist:
    """A velocity in the body's frame: v forward in m/s, w counter-clockwise in rad/s."""

    v: float
    w: float


class Flags(IntFlag):
    """What the base reports of itself; a robot without one of these never sets it."""

    NONE = 0
    LATCHED = 1
    BUMPER = 2
    MOTOR_FAULT = 4
    DEADMAN = 8
    BATTERY_LOW = 16


@dataclass(frozen=True, slots=True)
class Identity:
    """What a robot says of itself when asked; a new `boot_id` means that it restarted."""

    name: str
    sensors: int
    ring_radius_m: float
    deadman_s: float
    odometry_period_s: float
    boot_id: int


@dataclass(frozen=True, slots=True)
class Odometry:
    """Where the base believes it is, at its own time `robot_s` (seconds since boot, unwrapped).

    `pose.theta` is the direction in which the wheels drive; `ring_yaw` the direction of the ring's sensor 0. They
    are one angle on a base whose body turns with its wheels and two on a synchro drive. Both are unwrapped.
    """

    robot_s: float
    pose: Pose
    ring_yaw: float
    twist: Twist
    flags: Flags
    last_drive_seq: int


@dataclass(frozen=True, slots=True, eq=False)
class Firing:
    """One firing of a set of sensors, stamped with the pose at that moment.

    `ranges_m` has shape (sensors,), one entry for each sensor of the ring, fired or not: NaN did not fire (or
    reported a fault), +inf fired and heard nothing inside the window, else metres. `robot_s` is the robot's own time.
    """

    robot_s: float
    pose: Pose
    ring_yaw: float
    ranges_m: Floats


@dataclass(frozen=True, slots=True)
class LinkCounts:
    """What went over the line since it was first opened: good frames in, bad frames, frames known lost."""

    frames: int = 0
    bad: int = 0
    lost: int = 0
