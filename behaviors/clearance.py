"""How fast the robot may go straight ahead and still stop in time, whatever the schemas add up to.

Pushes cancel: with something right in front and something right behind, avoid-static-obstacle sums to nothing and
move-ahead alone would drive on. So the arbiter limits the speed by what lies in the way, as an admissible velocity
in the sense of Fox, Burgard & Thrun, *The Dynamic Window Approach to Collision Avoidance*, 1997.
"""

from __future__ import annotations

import math

import numpy as np

from config.robot import BodyConfig
from perception.percept import Percept


def free_path_m(percept: Percept, reach_m: float) -> float:
    """Return how far a disc of radius `reach_m` can go straight ahead before it meets an echo.

    Zero where an echo ahead is inside the disc already, infinite where none is in the way.
    """
    if len(percept.obstacles) == 0:
        return math.inf
    c, s = math.cos(percept.pose.theta), math.sin(percept.pose.theta)
    dx = percept.obstacles[:, 0] - percept.pose.x
    dy = percept.obstacles[:, 1] - percept.pose.y
    ahead, aside = c * dx + s * dy, c * dy - s * dx
    in_the_way = (ahead > 0.0) & (np.abs(aside) < reach_m)
    if not in_the_way.any():
        return math.inf
    ahead, aside = ahead[in_the_way], aside[in_the_way]
    return max(0.0, float((ahead - np.sqrt(reach_m * reach_m - aside * aside)).min()))


def stoppable_speed_m_s(percept: Percept, body: BodyConfig, clearance_m: float) -> float:
    """Return the speed from which the base, braking as hard as it can, keeps `clearance_m` to every echo ahead."""
    return math.sqrt(2.0 * body.acceleration_max_m_s2 * free_path_m(percept, body.radius_m + clearance_m))
