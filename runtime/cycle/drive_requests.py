"""Drive requests: the configured legs, a goal, or an operator's velocity (`runtime.cycle.driving` carries them out).

A drive request alone moves nothing: it takes effect in DRIVE only. Leaving DRIVE drops a goal and an operator's
velocity, so that the robot does not resume them after a re-arm. Without a request the robot follows the configured
legs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from behaviors.move_to_goal import Goal
from behaviors.teleoperation import TELEOPERATION_ENDED, Teleoperate
from config.settings import Settings
from drivers.messages import Pose, Twist

STANDSTILL: Final = Twist(0.0, 0.0)
COORDINATE_MAX_M: Final = 10_000.0
"""Largest coordinate of a goal, m: one beyond it is taken for a typing error."""

GOAL_SLEW_M_S: Final = 0.2
"""So fast may a goal in the map move in odometry's frame, where the robot drives, when its place is corrected."""


@dataclass(frozen=True, slots=True)
class Legs:
    """Follow the configured legs (`behaviors.move_ahead`)."""

    kind: Literal["legs"] = "legs"


DriveRequest: TypeAlias = Legs | Goal | Teleoperate


def first_request(settings: Settings) -> DriveRequest:
    """Return what is driven at the start of a run: to the configured goal, otherwise the legs."""
    goal = settings.goal
    return Legs() if goal is None else Goal(goal.x_m, goal.y_m, frame=goal.frame)


@dataclass(frozen=True, slots=True)
class GoalPlace:
    """Where a goal lies in odometry's frame, m, as the robot drives to it; and whether it truly lies there."""

    x: float
    y: float
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


def validate(drive_request: DriveRequest) -> str | None:
    """Return why a drive request is invalid, None if it is valid."""
    match drive_request:
        case Goal(x, y):
            if not (abs(x) <= COORDINATE_MAX_M and abs(y) <= COORDINATE_MAX_M):
                return f"invalid goal ({x:g}, {y:g}): expected metres, at most {COORDINATE_MAX_M:g} along each axis"
        case Teleoperate(v, w, valid_s):
            if not (math.isfinite(v) and math.isfinite(w) and valid_s >= 0.0):
                return (
                    f"invalid velocity ({v:g}, {w:g}) for {valid_s:g} s: "
                    "expected finite m/s and rad/s, duration ≥ 0 s"
                )
    return None


def after_stop(drive_request: DriveRequest) -> DriveRequest:
    """Return what remains of a drive request once the robot has left DRIVE: the legs, or nothing."""
    return drive_request if isinstance(drive_request, Legs) else TELEOPERATION_ENDED
