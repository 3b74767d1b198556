"""Drive requests: the configured legs, a goal, or an operator's velocity; and the schemas that each one uses.

A drive request alone moves nothing: it takes effect in DRIVE only. Leaving DRIVE drops a goal and an operator's
velocity, so that the robot does not resume them after a re-arm. Without a request the robot follows the configured
legs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

from behaviors.arbiter import Decision, Drive, arbitrate, limit_velocity
from behaviors.avoid_static_obstacle import SCHEMA as AVOID
from behaviors.avoid_static_obstacle import avoid_static_obstacle
from behaviors.field_of_view import unseen_way
from behaviors.move_ahead import SCHEMA as AHEAD
from behaviors.move_ahead import Leg, move_ahead
from behaviors.move_to_goal import SCHEMA as TO_GOAL
from behaviors.move_to_goal import Goal, move_to_goal
from behaviors.response import Response
from behaviors.teleoperation import SCHEMA as TELEOPERATION
from behaviors.teleoperation import TELEOPERATION_ENDED, Teleoperate, is_expired, teleoperation
from config.settings import Settings
from drivers.messages import Pose, Twist
from perception.percept import Percept

STANDSTILL: Final = Twist(0.0, 0.0)
COORDINATE_MAX_M: Final = 10_000.0
"""Largest coordinate of a goal, m: one beyond it is taken for a typing error."""
SUM: Final = "sum"
"""Name of the sum of all responses, in place of a schema's name."""

NO_CONTROL: Final = "no velocity arrives from an operator: teleoperate, set a goal, or resume the legs"
NO_PLACE: Final = (
    "the goal is a place in the map, and the robot does not know its own there: wait until it does, say where it is, "
    "or set a goal in odometry's frame"
)
GOAL_SLEW_M_S: Final = 0.2
"""So fast may a goal in the map move in odometry's frame, where the robot drives, when its place is corrected."""
LEG_DONE: Final = "the leg is done"


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
class DriveResult:
    """What a drive request led to in one cycle."""

    decision: Decision
    vectors: tuple[Response, ...]
    """The schemas' responses and, last, their sum under the name `SUM`."""
    drive_request: DriveRequest
    """The request after the cycle: a goal may have been reached, a velocity may have expired."""
    leg: Leg
    hold_reason: str | None = None
    """Why the robot does not move although it may drive, for the operator."""


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


def drive(
    drive_request: DriveRequest, requested_run_s: float, run_s: float, leg: Leg, percept: Percept, settings: Settings,
    place: GoalPlace | None = None,
) -> DriveResult:  # fmt: skip
    """Return the arbiter's decision on the responses of the schemas that the request asks for.

    Parameters
    ----------
    drive_request : DriveRequest
        The motion requested of the robot.
    requested_run_s, run_s : float
        When that was requested, and now, by the run's clock.
    leg : Leg
        How far the current leg has come, for `Legs`.
    percept : Percept
        What the robot sees.
    settings : Settings
        The run's.
    place : GoalPlace, optional
        Where a goal lies, from `goal_place`.
    """
    behaviors, body = settings.behaviors, settings.body
    away = avoid_static_obstacle(percept, body.radius_m, behaviors.avoid_static_obstacle)
    if isinstance(drive_request, Teleoperate):
        # The last cycle before the deadline stops: the next one would come after it.
        age_s = run_s - requested_run_s
        if drive_request != TELEOPERATION_ENDED and is_expired(
            drive_request, age_s + 1.0 / settings.cycle.rate_hz, behaviors.teleoperation
        ):
            drive_request = TELEOPERATION_ENDED
        steer = teleoperation(percept, drive_request, behaviors.arbiter.base_velocity_m_s)
        avoids = behaviors.teleoperation.avoid
        responses, expected = ((steer, away), (TELEOPERATION, AVOID)) if avoids else ((steer,), (TELEOPERATION,))
        requested = Twist(drive_request.v, drive_request.w)
        decision = limit_velocity(requested, responses, percept, body, behaviors.arbiter, expected)
        hold_reason = NO_CONTROL if drive_request == TELEOPERATION_ENDED else None
        if hold_reason is None and requested.v != 0.0 and isinstance(decision, Drive) and decision.twist.v == 0.0:
            way = percept.pose.theta + (0.0 if requested.v > 0.0 else math.pi)
            unseen = unseen_way(percept, way, body, behaviors.arbiter.clearance_m)
            hold_reason = None if unseen is None else unseen.reason
        return DriveResult(decision, with_sum(responses, decision), drive_request, leg, hold_reason)
    if isinstance(drive_request, Goal):
        if place is None and not drive_request.reached:
            return DriveResult(Drive(STANDSTILL), (), drive_request, leg, NO_PLACE)
        there = drive_request if place is None else replace(drive_request, x=place.x, y=place.y)
        to_goal, there = move_to_goal(percept, there, behaviors.move_to_goal)
        is_reached = there.reached and (place is None or place.is_exact)
        drive_request = replace(drive_request, reached=drive_request.reached or is_reached)
        responses = (to_goal, away)
        decision = arbitrate(responses, percept, body, behaviors.arbiter, (TO_GOAL, AVOID))
        if drive_request.reached and isinstance(decision, Drive):
            reached = f"the goal ({drive_request.x:.2f} m, {drive_request.y:.2f} m) is reached"
            return DriveResult(Drive(STANDSTILL), with_sum(responses, decision), drive_request, leg, reached)
        return DriveResult(decision, with_sum(responses, decision), drive_request, leg)
    ahead, leg = move_ahead(percept, leg, behaviors.move_ahead)
    decision = arbitrate((ahead, away), percept, body, behaviors.arbiter, (AHEAD, AVOID))
    hold_reason = LEG_DONE if leg.done else None
    return DriveResult(decision, with_sum((ahead, away), decision), drive_request, leg, hold_reason)


def with_sum(responses: tuple[Response, ...], decision: Decision) -> tuple[Response, ...]:
    """Return the responses and, last, their sum; nothing where the decision is a stop, as they may not be finite."""
    if not isinstance(decision, Drive):
        return ()
    return (*responses, Response(SUM, sum(r.x for r in responses), sum(r.y for r in responses)))
