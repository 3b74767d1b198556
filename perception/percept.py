"""What the behaviours get to know: the door between perception/ and behaviors/.

Behaviours import nothing of ours but this module and config, so everything they need from below comes through here.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers.messages import Floats, Pose, Twist, wrap_angle

__all__ = ["Floats", "Percept", "Pose", "Twist", "wrap_angle"]


@dataclass(frozen=True, slots=True, eq=False)
class Percept:
    """The world as one cycle sees it, in the odometry's frame: metres and radians.

    `pose.theta` is the drive heading. `obstacles` has shape (n, 2): the points at which fresh echoes came back, all
    finite. `objects` are the objects recognised so far, for schemas that go to one.
    """

    pose: Pose
    obstacles: Floats
    objects: tuple[object, ...] = ()
