"""The swirl schema (MissionLab's swirl-static-obstacles): obstacles deflect the robot to the side of its way.

Each obstacle's repulsion is turned by a right angle, to the side on which the way leads past it, so that the sum does
not cancel the way in front of an obstacle but leads round it.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from behaviors.response import Response
from config.behaviors import SwirlConfig
from perception.percept import Percept

SCHEMA: Final = "swirl"


def swirl(percept: Percept, way_rad: float, body_radius_m: float, config: SwirlConfig) -> Response:
    """Return the sum of the turned repulsions, no longer than the longest of them.

    Parameters
    ----------
    percept
        Pose and obstacles.
    way_rad
        Direction in which the robot wants to go, rad in the odometry's frame. An obstacle to the left of it is passed
        on the right; one straight ahead counts as left.
    body_radius_m
        Distances are measured from the rim, this far from the pose, m.
    config
        The schema's settings.
    """
    dx, dy = percept.obstacles[:, 0] - percept.pose.x, percept.obstacles[:, 1] - percept.pose.y
    distances = np.hypot(dx, dy)
    if len(distances) == 0:
        return Response(SCHEMA, 0.0, 0.0)
    lengths = np.where(distances == 0.0, 1.0, distances)
    span = config.swirl_sphere_m - config.swirl_safety_margin_m
    share = np.clip((config.swirl_sphere_m - (distances - body_radius_m)) / span, 0.0, 1.0) / lengths
    passes_right = math.cos(way_rad) * dy - math.sin(way_rad) * dx >= 0.0
    turned = np.where(passes_right, share, -share)
    x, y = float((turned * dy).sum()), float((-turned * dx).sum())
    magnitude, longest = math.hypot(x, y), float((share * lengths).max())
    shrink = config.swirl_gain * min(1.0, longest / magnitude) if magnitude > 0.0 else 0.0
    return Response(SCHEMA, shrink * x, shrink * y)
