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

    Attributes
    ----------
    bearings_rad : (k,) float
        Axis of the beam in each look, in the odometry's frame, rad.
    ages_s : (k,) float
        Time since the look, s.
    axes_rad : (n,) float
        Axis of each sensor now, in the odometry's frame, rad.
    sensor_ages_s : (n,) float
        Time since each sensor last looked anywhere, s; infinite for one that has not yet.
    half_angle_rad : float
        Half the width of a beam, below π/2, rad.
    reach_m : float
        Distance from the centre to which a silence shows free space, m.
    age_max_s : float
        Longest age at which a direction counts as seen, s.
    unknown_rad : (u,) float
        Directions on the ring's blind sides of which nothing is known, in the odometry's frame, rad.
    presumed : (p, 2) float
        Those of the obstacles that the ring heard from elsewhere as walls and presumes to go on, m.
    """

    bearings_rad: Floats
    ages_s: Floats
    axes_rad: Floats
    sensor_ages_s: Floats
    half_angle_rad: float
    reach_m: float
    age_max_s: float
    unknown_rad: Floats = field(default_factory=lambda: np.zeros(0))
    presumed: Floats = field(default_factory=lambda: np.zeros((0, 2)))


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyWindow:
    """What the evidence grid holds around the robot.

    Attributes
    ----------
    occupied : (n, n) float32
        Probability that something in the cell has answered in some direction, row by row from the smallest y; 0.5
        where nothing is known.
    x_m, y_m : float
        The outer corner of the first cell, in the odometry's frame, m.
    cell_m : float
        Side of a cell, m.
    """

    occupied: NDArray[np.float32]
    x_m: float
    y_m: float
    cell_m: float


@dataclass(frozen=True, slots=True)
class Canyon:
    """A box canyon: a dead end whose only way out for this robot is its mouth (m, rad, odometry's frame).

    Attributes
    ----------
    number : int
        The same for the same canyon as long as the robot remembers it.
    mouth : tuple of float
        Ends of the mouth, x1, y1, x2, y2.
    axis_rad : float
        Direction inwards, from the middle of the mouth to the back.
    depth_m : float
        Distance from the mouth to the back.
    probability : float
        That the back and both sides are closed for this robot, 0 to 1.
    """

    number: Count
    mouth: tuple[Coordinate, Coordinate, Coordinate, Coordinate]
    axis_rad: Coordinate
    depth_m: Coordinate
    probability: Coordinate


@dataclass(frozen=True, slots=True, eq=False)
class Percept:
    """The surroundings in one cycle, in the odometry's frame (m, rad).

    Attributes
    ----------
    pose : Pose
        Pose of the robot; `pose.theta` is the drive heading.
    obstacles : (n, 2) float
        Points at which fresh echoes came back, all finite, m.
    field_of_view : FieldOfView
        Where the ring has looked.
    objects : tuple of DetectedObject
        The objects recognised near the robot, for missions that look for one; empty if none does.
    occupancy : OccupancyWindow or None
        The evidence grid around the robot; None where no schema needs it.
    canyons : tuple of Canyon
        The box canyons near the robot.
    steady : (m, 2) float or None
        Those obstacles with which another look agrees, m; None where no schema needs them.
    no_go : int
        So many of the obstacles, the last ones, stand for no-go lines.
    """

    pose: Pose
    obstacles: Floats
    field_of_view: FieldOfView
    objects: tuple[DetectedObject, ...] = ()
    occupancy: OccupancyWindow | None = None
    canyons: tuple[Canyon, ...] = ()
    steady: Floats | None = None
    no_go: int = 0
