"""The percept: the input of the behaviours, which import only this module and `config` of this program."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.messages import Floats, Pose, Twist, wrap_angle

__all__ = ["Floats", "Percept", "Pose", "Twist", "wrap_angle"]


@dataclass(frozen=True, slots=True, eq=False)
class Percept:
    """The surroundings in one cycle, in the odometry's frame (m, rad).

    Attributes
    ----------
    pose : Pose
        Pose of the robot; `pose.theta` is the drive heading.
    obstacles : (n, 2) float
        Points at which fresh echoes came back, all finite, m.
    objects : tuple of DetectedObject
        The objects recognised so far, for schemas that approach one.
    """

    pose: Pose
    obstacles: Floats
    objects: tuple[object, ...] = ()
