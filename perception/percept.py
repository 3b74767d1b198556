"""The percept: the input of the behaviours, which import only it, the kernel decorator and `config`."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from config.bounded import Coordinate, Count
from drivers.messages import Floats, Pose, Twist, wrap_angle
from perception.detected_object import DetectedObject

__all__ = [
    "Canyon",
    "DetectedObject",
    "FieldOfView",
    "Floats",
    "OccupancyWindow",
    "Percept",
    "Pose",
    "Twist",
    "wrap_angle",
]


@dataclass(frozen=True, slots=True, eq=False)
class FieldOfView:
    """The directions in which the ring has looked, and when.

    A sensor has looked when it gave a usable range, or a silence that is believed. One that is masked, reports a
    fault or does not fire has not.
    """

    bearings_rad: Floats
    """(k,): axis of the beam in each look, in the odometry's frame, rad."""
    ages_s: Floats
    """(k,): time since the look, s."""
    axes_rad: Floats
    """(n,): axis of each sensor now, in the odometry's frame, rad."""
    sensor_ages_s: Floats
    """(n,): time since each sensor last looked anywhere, s; infinite for one that has not yet."""
    half_angle_rad: float
    """Half the width of a beam, below π/2, rad."""
    reach_m: float
    """Distance from the centre to which a silence shows free space, m."""
    age_max_s: float
    """Longest age at which a direction counts as seen, s."""
    unknown_rad: Floats = field(default_factory=lambda: np.zeros(0))
    """(u,): directions on the ring's blind sides of which nothing is known, in the odometry's frame, rad."""
    presumed: Floats = field(default_factory=lambda: np.zeros((0, 2)))
    """(p, 2): those of the obstacles that the ring heard from elsewhere as walls and presumes to go on, m."""


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyWindow:
    """What the evidence grid holds around the robot."""

    occupied: NDArray[np.float32]
    """(n, n): probability that something in the cell has answered in some direction, row by row from the smallest y;
    0.5 where nothing is known."""
    x_m: float
    y_m: float
    """The outer corner of the first cell, in the odometry's frame, m."""
    cell_m: float
    """Side of a cell, m."""


@dataclass(frozen=True, slots=True)
class Canyon:
    """A box canyon: a dead end whose only way out for this robot is its mouth (m, rad, odometry's frame)."""

    number: Count
    """The same for the same canyon as long as the robot remembers it."""
    mouth: tuple[Coordinate, Coordinate, Coordinate, Coordinate]
    """Ends of the mouth, x1, y1, x2, y2."""
    axis_rad: Coordinate
    """Direction inwards, from the middle of the mouth to the back."""
    depth_m: Coordinate
    """Distance from the mouth to the back."""
    probability: Coordinate
    """That the back and both sides are closed for this robot, 0 to 1."""


@dataclass(frozen=True, slots=True, eq=False)
class Percept:
    """The surroundings in one cycle, in the odometry's frame (m, rad)."""

    pose: Pose
    """Pose of the robot; `pose.theta` is the drive heading."""
    obstacles: Floats
    """(n, 2): points at which fresh echoes came back, all finite, m."""
    field_of_view: FieldOfView
    """Where the ring has looked."""
    objects: tuple[DetectedObject, ...] = ()
    """The objects recognised near the robot, for missions that look for one; empty if none does."""
    occupancy: OccupancyWindow | None = None
    """The evidence grid around the robot; None where no schema needs it."""
    canyons: tuple[Canyon, ...] = ()
    """The box canyons near the robot."""
    steady: Floats | None = None
    """(m, 2): those obstacles with which another look agrees, m; None where no schema needs them."""
    no_go: int = 0
    """So many of the obstacles, the last ones, stand for no-go lines."""
