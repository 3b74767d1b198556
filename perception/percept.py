"""The percept: the input of the behaviours, which import only this module and `config` of this program."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.messages import Floats, Pose, Twist, wrap_angle

__all__ = ["FieldOfView", "Floats", "Percept", "Pose", "Twist", "wrap_angle"]


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
    """

    bearings_rad: Floats
    ages_s: Floats
    axes_rad: Floats
    sensor_ages_s: Floats
    half_angle_rad: float
    reach_m: float
    age_max_s: float


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
        The objects recognised so far, for schemas that approach one.
    """

    pose: Pose
    obstacles: Floats
    field_of_view: FieldOfView
    objects: tuple[object, ...] = ()
