"""Where a place of the map lies in odometry's frame, in which the robot drives, without jumps when the map moves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from behaviors.move_to_goal import Goal
from config.bounded import Coordinate
from perception.percept import Pose

GOAL_SLEW_M_S: Final = 0.2
"""So fast may a goal in the map move in odometry's frame, where the robot drives, when its place is corrected."""


@dataclass(frozen=True, slots=True)
class GoalPlace:
    """Where a goal lies in odometry's frame, m, as the robot drives to it; and whether it truly lies there."""

    x: Coordinate
    y: Coordinate
    is_exact: bool = True


def goal_place(goal: Goal, before: GoalPlace | None, map_frame: Pose | None, step_s: float) -> GoalPlace | None:
    """Return where a goal lies in odometry's frame; a corrected map moves it smoothly, so that the drive never jumps.

    Parameters
    ----------
    goal : Goal
        In either frame.
    before : GoalPlace or None
        In the cycle before; None if the goal is new, or its place was not known.
    map_frame : Pose or None
        The map frame in odometry's; None while the robot's place in the map is not known.
    step_s : float
        Time since the cycle before, s.

    Returns
    -------
    GoalPlace or None
        None while the place is not known.
    """
    if goal.frame == "odom":
        return GoalPlace(goal.x, goal.y)
    if map_frame is None:
        return None
    there = map_frame.compose(Pose(goal.x, goal.y, 0.0))
    if before is None:
        return GoalPlace(there.x, there.y)
    dx, dy = there.x - before.x, there.y - before.y
    away, most = math.hypot(dx, dy), GOAL_SLEW_M_S * step_s
    if away <= most:
        return GoalPlace(there.x, there.y)
    return GoalPlace(before.x + dx * most / away, before.y + dy * most / away, is_exact=False)
