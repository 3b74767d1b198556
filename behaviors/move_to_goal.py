"""The move-to-goal schema (Arkin 1989): a vector towards a goal.

Far from the goal, in the ballistic zone, its magnitude is the gain. Within the controlled zone (Arkin & Murphy 1990,
docking) it falls with the distance, so that the robot arrives slowly. Within the success radius the goal is reached,
and it stays reached even if the robot is pushed away: motion does not resume by itself. Behaviours hold no state, so
the goal is passed in and returned with each call.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, Literal

from behaviors.response import Response
from config.behaviors import MoveToGoalConfig
from perception.percept import Percept

SCHEMA: Final = "move_to_goal"


@dataclass(frozen=True, slots=True)
class Goal:
    """A place to drive to (m), the frame in which it stays where it is, and whether it has been reached."""

    x: float
    y: float
    reached: bool = False
    frame: Literal["odom", "map"] = "odom"
    kind: Literal["goal"] = "goal"
    heading: float | None = None
    """The final heading in that frame, rad; None for any."""
    aligned: bool = False
    """Whether the robot has turned to the final heading, once it was there."""


def move_to_goal(percept: Percept, goal: Goal, config: MoveToGoalConfig) -> tuple[Response, Goal]:
    """Return the schema's vector and the goal for the next call.

    With d the distance, C the controlled zone, G the gain: magnitude G for d ≥ C, G·d/C below, and zero within the
    success radius.

    Parameters
    ----------
    percept
        Only the pose is used.
    goal
        The goal, whose coordinates are taken in the frame of the percept's pose, and whether it has been reached.
    config
        The schema's settings.
    """
    dx, dy = goal.x - percept.pose.x, goal.y - percept.pose.y
    distance = math.hypot(dx, dy)
    if goal.reached or distance <= config.success_radius_m:
        return Response(SCHEMA, 0.0, 0.0), goal if goal.reached else replace(goal, reached=True)
    magnitude = config.move_to_goal_gain * min(1.0, distance / config.controlled_zone_m)
    return Response(SCHEMA, magnitude * dx / distance, magnitude * dy / distance), goal
