"""Where recognised objects are nearest to the robot, although no beam meets them there.

Close to the rim the beams of a ring leave gaps, and a mirror answers in one direction only: a robot that turns about
a drum may hear nothing of it for a quarter of the way round, and what it heard before is too old. What it has
recognised stands there all the same.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from config.model import ModelConfig
from drivers.messages import Floats, Pose
from perception.detected_object import DetectedObject

NEAR_M: Final = 0.5
"""A foot that is farther from the ring than this is left to the echoes: the rim of a `p3at` is .17 m outside its
ring, and from .3 m/s it stops in .15 m, .16 m clear. With .8 m drives in the paper's hall depend on the method."""
FOOT_HEARD_M: Final = 0.05
"""An echo that is nearer to a foot than this stands for it: a third of the clearance that the arbiter keeps."""


def with_unheard_feet(
    echoes: Floats, objects: Iterable[DetectedObject], models: Sequence[ModelConfig], pose: Pose, ring_m: float
) -> Floats:
    """Return echoes, and the foot of each near object at which there is none, shape (k, 2), m.

    Parameters
    ----------
    echoes : (n, 2) float
        Places at which fresh echoes came back, m.
    objects : iterable of DetectedObject
        What is recognised, in the frame of the echoes; what has no probability is no obstacle by itself.
    models : sequence of ModelConfig
        Their outlines.
    pose : Pose
        The robot's.
    ring_m : float
        Distance of the farthest sensor from the robot's centre, m.
    """
    here, by_name, near_m = (pose.x, pose.y), {model.name: model for model in models}, ring_m + NEAR_M
    feet = (
        foot_of(one, by_name[one.model], pose)
        for one in objects
        if one.probability is not None
        and one.model in by_name
        and math.dist((one.x, one.y), here) < near_m + by_name[one.model].reach_m
    )
    near = [foot for foot in feet if math.dist(foot, here) < near_m]
    unheard = [foot for foot in near if not (np.hypot(*(echoes - foot).T) < FOOT_HEARD_M).any()]
    return np.concatenate([echoes, unheard]) if unheard else echoes


def foot_of(seen: DetectedObject, model: ModelConfig, pose: Pose) -> tuple[float, float]:
    """Return the place on an object's outline that is nearest to the robot's centre, m."""
    if model.arc_radius_m is not None:
        bearing = math.atan2(pose.y - seen.y, pose.x - seen.x)
        return seen.x + model.arc_radius_m * math.cos(bearing), seen.y + model.arc_radius_m * math.sin(bearing)
    frame = Pose(seen.x, seen.y, seen.theta)
    robot = frame.inverse().compose(pose)
    corners = [*model.vertices_m, *model.vertices_m[: model.closed]]
    feet = (_foot_on(a, b, robot.x, robot.y) for a, b in pairwise(corners))
    x, y = min(feet, key=lambda foot: math.dist(foot, (robot.x, robot.y)))
    foot = frame.compose(Pose(x, y, 0.0))
    return foot.x, foot.y


def _foot_on(a: tuple[float, float], b: tuple[float, float], x: float, y: float) -> tuple[float, float]:
    """Return the place of a side that is nearest to a point."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    along = ((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy)
    along = min(max(along, 0.0), 1.0)
    return a[0] + along * dx, a[1] + along * dy
