"""The follow-wall schema: drives along the nearest surface on one side and keeps its distance from it.

The nearest echo on that side or ahead is where a wall's perpendicular meets the robot, which is what a smooth wall
answers with. The robot drives across the direction of it, turned towards the wall if it is too far and away if it is
too near. So an inner corner turns the robot as soon as the wall ahead is the nearer one, at an outer corner it goes
round the edge, and an opening too narrow for the robot is passed.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from behaviors.response import Response
from behaviors.schema_call import Answer, Memory, Scene
from config.mission_step import FollowWallUse

SCHEMA: Final = "follow_wall"
STEER_RAD_PER_M: Final = 1.6
"""Turn towards the wall for each metre of distance too much. Chosen for this program, as are the angles below."""
STEER_MAX_RAD: Final = math.radians(60.0)
"""Steepest way towards the wall or from it."""
AHEAD_RAD: Final = math.radians(20.0)
"""The wall is looked for from this far to the other side of the heading."""
BEHIND_RAD: Final = math.radians(150.0)
"""The wall is looked for to this far round on its own side."""


def follow_wall(scene: Scene, memory: Memory, use: FollowWallUse) -> Answer:
    """Return a vector along the wall; straight ahead while there is none.

    Parameters
    ----------
    scene
        Pose, echoes and body.
    memory
        Not used.
    use
        Gain, side, distance kept, and from how far a wall is approached.
    """
    pose, obstacles = scene.percept.pose, scene.percept.obstacles
    sign = 1.0 if use.side == "left" else -1.0
    dx, dy = obstacles[:, 0] - pose.x, obstacles[:, 1] - pose.y
    # From here on the wall is on the left: a wall on the right is seen in a mirror.
    bearings = sign * (np.remainder(np.arctan2(dy, dx) - pose.theta + math.pi, 2.0 * math.pi) - math.pi)
    gaps = np.hypot(dx, dy) - scene.body.radius_m
    on_side = (bearings >= -AHEAD_RAD) & (bearings <= BEHIND_RAD)
    course = 0.0
    if on_side.any() and float(gaps[on_side].min()) <= use.search_m:
        nearest = int(np.flatnonzero(on_side)[np.argmin(gaps[on_side])])
        steer = STEER_RAD_PER_M * (float(gaps[nearest]) - use.distance_m)
        course = float(bearings[nearest]) - math.pi / 2.0 + max(-STEER_MAX_RAD, min(STEER_MAX_RAD, steer))
    direction = pose.theta + sign * course
    response = Response(SCHEMA, use.gain * math.cos(direction), use.gain * math.sin(direction))
    return Answer(response, memory, own_echoes=on_side)
