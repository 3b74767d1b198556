"""The turn schema: turns on the spot to a direction, and arrives when the robot looks there."""

from __future__ import annotations

import math
from typing import Final

from behaviors.response import Response
from behaviors.schema_call import Answer, Memory, Scene
from config.mission_step import TurnUse
from perception.percept import Pose, wrap_angle

SCHEMA: Final = "turn"
ALIGNED_RAD: Final = math.radians(3.0)
"""A direction within this of the heading is reached: a fast turn stops in about a cycle's share of it."""
UNKNOWN_FRAME: Final = "the robot does not know its place in the map: wait until it does, or say where it is"


def turn(scene: Scene, memory: Memory, use: TurnUse) -> Answer:
    """Return the direction to turn to.

    Parameters
    ----------
    scene
        The pose now and as the step began, and the map frame.
    memory
        Not used.
    use
        The heading, and what it counts from.
    """
    still = Response(SCHEMA, 0.0, 0.0)
    frame = scene.start if use.relative_to == "robot" else scene.frame(use.relative_to)
    if frame is None:
        return Answer(still, memory, waits_for=UNKNOWN_FRAME)
    direction = frame.theta + math.radians(use.heading_deg)
    return Answer(still, memory, has_arrived=is_aligned(scene.percept.pose, direction), turn_to_rad=direction)


def is_aligned(pose: Pose, direction_rad: float) -> bool:
    """Return whether a robot at a pose looks in a direction, both of odometry's frame."""
    return abs(wrap_angle(direction_rad - pose.theta)) <= ALIGNED_RAD
