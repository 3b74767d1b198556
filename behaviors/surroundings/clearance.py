"""The speed from which the robot can stop before the nearest echo ahead, whatever the schemas request.

Repulsions cancel: between an obstacle in front and one behind, avoid-static-obstacle sums to zero, and move-ahead
alone would drive on. So the arbiter limits the speed to the admissible velocity of Fox, Burgard & Thrun, *The Dynamic
Window Approach to Collision Avoidance*, 1997.
"""

from __future__ import annotations

import math

import numpy as np

from config.robot import PASSAGE_M, BodyConfig
from perception.percept import Floats, Percept, Pose


def free_path_m(percept: Percept, reach_m: float, beside_m: float = math.inf) -> float:
    """Return how far a disc of radius `reach_m` can drive straight ahead before it meets an echo, m.

    Zero if an echo ahead is inside the disc already, infinite if the path is free. What the disc would pass at
    `beside_m` or more from its middle is not met.
    """
    half_m = min(reach_m, beside_m)
    pose, free_m = percept.pose, math.inf
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    for x, y in percept.obstacles.tolist():  # some dozens: numpy's calls would take longer
        dx, dy = x - pose.x, y - pose.y
        ahead, lateral = c * dx + s * dy, c * dy - s * dx
        if ahead > 0.0 and abs(lateral) < half_m:
            free_m = min(free_m, ahead - math.sqrt(reach_m * reach_m - lateral * lateral))
    return max(0.0, free_m)


def free_paths_m(points: Floats, pose: Pose, headings_rad: Floats, reach_m: float) -> Floats:
    """Return the same along several headings, for any points: shape (k,), m.

    Parameters
    ----------
    points
        Shape (n, 2), m.
    pose
        Where the disc starts; its heading does not matter.
    headings_rad
        Shape (k,).
    reach_m
        Radius of the disc, m.
    """
    dx, dy = points[:, 0] - pose.x, points[:, 1] - pose.y
    c, s = np.cos(headings_rad)[:, None], np.sin(headings_rad)[:, None]
    ahead, lateral = c * dx + s * dy, c * dy - s * dx
    in_the_way = (ahead > 0.0) & (np.abs(lateral) < reach_m)
    paths = ahead - np.sqrt(np.maximum(reach_m * reach_m - lateral * lateral, 0.0))
    nearest: Floats = np.where(in_the_way, paths, math.inf).min(axis=1, initial=math.inf)
    return np.maximum(nearest, 0.0)


def stoppable_speed_m_s(percept: Percept, body: BodyConfig, clearance_m: float, cautious_m_s: float = 0.0) -> float:
    """Return the highest speed from which full braking keeps `clearance_m` to every echo ahead, m/s.

    A cautious robot keeps it to what it would run into, and `PASSAGE_M` to what it passes: so it drives through a
    doorway whose posts are within the clearance.

    Parameters
    ----------
    percept
        Pose and obstacles of this cycle.
    body
        Radius and largest deceleration of the base.
    clearance_m
        Distance to keep between rim and echo, m.
    cautious_m_s
        Speed of a cautious robot, m/s; 0: the clearance is kept to what is passed, too.
    """
    reach_m = body.radius_m + clearance_m
    speed = math.sqrt(2.0 * body.acceleration_max_m_s2 * free_path_m(percept, reach_m))
    if speed >= cautious_m_s:
        return speed
    passing_m = free_path_m(percept, reach_m, body.radius_m + PASSAGE_M)
    return max(speed, min(cautious_m_s, math.sqrt(2.0 * body.acceleration_max_m_s2 * passing_m)))
