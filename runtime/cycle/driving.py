"""The schemas that each drive request uses, and the arbiter's decision on their responses."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, NamedTuple

from behaviors.arbiter import Decision, Drive, arbitrate, limit_velocity
from behaviors.avoid_static_obstacle import SCHEMA as AVOID
from behaviors.avoid_static_obstacle import avoid_static_obstacle
from behaviors.follow_valley import SCHEMA as VALLEY
from behaviors.leave_canyon import SCHEMA as CANYON
from behaviors.memory.way_progress import ENDED_S
from behaviors.missions.drive_mission import drive_mission, given_up
from behaviors.missions.mission import Mission
from behaviors.move_ahead import SCHEMA as AHEAD
from behaviors.move_ahead import Leg, move_ahead
from behaviors.move_to_goal import SCHEMA as TO_GOAL
from behaviors.move_to_goal import Goal
from behaviors.response import Response, summed
from behaviors.schema_call import ODOM_FRAME, Scene
from behaviors.surroundings.field_of_view import unseen_way
from behaviors.teleoperation import TELEOPERATION_ENDED, Teleoperate, blocked_by, is_expired, teleoperation
from behaviors.turn import is_aligned
from config.mission import StepConfig
from config.settings import Settings
from drivers.messages import Pose, Twist
from perception.percept import Percept, wrap_angle
from runtime.cycle.drive_requests import STANDSTILL
from runtime.cycle.drive_state import DriveState, Moment, StepSettings
from runtime.cycle.escape_schemas import escape_schemas
from runtime.cycle.goal_drive import drive_through_valley, drive_to_goal
from runtime.cycle.motion_monitor import CRAWL
from runtime.cycle.stalled_drives import DriveMemory, observe_way
from runtime.cycle.velocity_limits import zone_of_goal

SUM: Final = "sum"
"""Name of the sum of all responses, in place of a schema's name."""
NO_CONTROL: Final = "no velocity arrives from an operator: teleoperate, set a goal, or resume the legs"
NO_PLACE: Final = (
    "the goal is a place in the map, and the robot does not know its own there: wait until it does, say where it is, "
    "or set a goal in odometry's frame"
)
PLACE_LOST: Final = (
    "the robot took itself to be at the goal, but the readings do not fit its place any more: wait until it is "
    "found, or say where it is; it will not set out by itself"
)
AWAY_M: Final = 0.5
"""A robot that is farther from its reached goal than its success radius by this was moved, or was not there, m."""
WAITS_TO_START: Final = "the robot has only just stopped, and starts again two seconds after its last start"
LEG_DONE: Final = "the leg is done"
LEG_GIVEN_UP: Final = (
    f"the leg has ended, as the robot came hardly farther along it for {ENDED_S:.0f} s: clear the way and resume the "
    "legs, or set a goal"
)
NO_WAY: Final = (
    "step {} finds no way: something is too near ahead, or the schemas cancel one another; if that lasts, the step "
    "is stuck"
)


class DriveResult(NamedTuple):
    """What a drive request led to in one cycle."""

    decision: Decision
    vectors: tuple[Response, ...]
    """The schemas' responses and, last, their sum under the name `SUM`."""
    state: DriveState
    """For the next cycle; made in this one."""
    hold_reason: str | None = None
    """Why the robot does not move although it may drive, for the operator."""


def drive(state: DriveState, percept: Percept, settings: Settings, now: Moment) -> DriveResult:
    """Return the arbiter's decision on the responses of the schemas that the request asks for.

    Parameters
    ----------
    state : DriveState
        Of the cycle before, with the request; not changed.
    percept : Percept
        What the robot sees.
    settings : Settings
        The run's.
    now : Moment
        When this is decided.
    """
    leg = Leg.starting_at(percept.pose) if state.leg is None else state.leg
    match state.drive_request:
        case Teleoperate() as velocity:
            result = _teleoperate(state, velocity, leg, percept, settings, now)
        case Goal() as goal:
            result = _to_goal(state, goal, leg, percept, settings, now)
        case Mission() as mission:
            result = _on_mission(state, mission, leg, percept, settings, now)
        case _:
            result = _along_legs(state, leg, percept, settings, now)
    stands = (
        isinstance(result.decision, Drive) and result.decision.twist == STANDSTILL and result.hold_reason is not None
    )
    after, memory = result.state, state.drive_memory
    progress, leg, stalled = observe_way(
        after.drive_request,
        leg if after.leg is None else after.leg,
        memory.progress,
        after.goal_drive,
        percept.pose,
        state.requested_run_s,
        now,
        settings,
        stands=stands,
    )
    after.leg, after.drive_memory = leg, DriveMemory(memory.commitment, progress)
    return result._replace(hold_reason=result.hold_reason or stalled)


def commit(after: DriveState, twist: Twist, requested_run_s: float, run_s: float) -> tuple[Twist, str | None]:
    """Return the velocity to command, without speed where a start waits, and why it waits.

    Parameters
    ----------
    after : DriveState
        For the next cycle. Updated by what the velocity commits to.
    twist : Twist
        The velocity after all limits.
    requested_run_s, run_s : float
        When the request was made, and now, by the run's clock, s.
    """
    request, requested, before = after.drive_request, 0, after.drive_memory.commitment
    if isinstance(request, Teleoperate):  # each message is a request: only another direction is a new one
        requested = (request.v > 0.0) - (request.v < 0.0)
    elif before.started_run_s is not None and before.started_run_s < requested_run_s:
        before = replace(before, started_run_s=None, side=0, turned_run_s=None)
    decided, (twist, commitment) = twist, before.commit(twist, run_s, requested)
    after.drive_memory = DriveMemory(commitment, after.drive_memory.progress)
    return twist, WAITS_TO_START if twist == STANDSTILL != decided else None


def _teleoperate(
    state: DriveState, drive_request: Teleoperate, leg: Leg, percept: Percept, settings: Settings, now: Moment
) -> DriveResult:
    """Return what an operator's velocity leads to."""
    behaviors, body = settings.behaviors, settings.body
    # The last cycle before the deadline stops: the next one would come after it.
    if drive_request != TELEOPERATION_ENDED and is_expired(
        drive_request, now.run_s - state.requested_run_s + 1.0 / settings.cycle.rate_hz, behaviors.teleoperation
    ):
        drive_request = TELEOPERATION_ENDED
    steer = teleoperation(percept, drive_request, behaviors.arbiter.base_velocity_m_s)
    responses: tuple[Response, ...] = (steer,)
    if behaviors.teleoperation.avoid:
        responses = (steer, avoid_static_obstacle(percept, body.radius_m, behaviors.avoid_static_obstacle))
    expected = tuple(response.schema for response in responses)
    requested = Twist(drive_request.v, drive_request.w)
    decision = limit_velocity(requested, responses, percept, body, behaviors.arbiter, expected)
    hold_reason = NO_CONTROL if drive_request == TELEOPERATION_ENDED else None
    least_m_s = min(
        CRAWL.along, abs(requested.v)
    )  # before an obstacle the speed falls towards zero without reaching it
    if hold_reason is None and isinstance(decision, Drive) and abs(decision.twist.v) < least_m_s:
        way = percept.pose.theta + (0.0 if requested.v > 0.0 else math.pi)
        unseen = unseen_way(percept, way, body, behaviors.arbiter.clearance_m)
        hold_reason = blocked_by(percept, requested.v, body.radius_m) if unseen is None else unseen.reason
    return DriveResult(decision, with_sum(responses, decision), state.after(drive_request, leg), hold_reason)


def _to_goal(
    state: DriveState, drive_request: Goal, leg: Leg, percept: Percept, settings: Settings, now: Moment
) -> DriveResult:
    """Return what a goal leads to; one in the map waits until the robot's own place there is known."""
    place = state.goal_place
    if place is None and not drive_request.reached:
        waits = state.after(drive_request, leg, goal_drive=state.goal_drive)
        return DriveResult(Drive(STANDSTILL), (), waits, NO_PLACE)
    there = drive_request if place is None else replace(drive_request, x=place.x, y=place.y)
    way_rad = math.atan2(there.y - percept.pose.y, there.x - percept.pose.x)
    others, trail = escape_schemas(percept, way_rad, now.run_s, state.trail, settings)
    forbidden = None if drive_request.reached else zone_of_goal(there, now.zones, settings)
    there, goal_drive, responses, decision, hold_reason = drive_to_goal(
        there, state.goal_drive, percept, now.run_s, others, settings, state.drive_memory.commitment, forbidden
    )
    is_reached = there.reached and (place is None or place.is_exact)
    drive_request = replace(drive_request, reached=drive_request.reached or is_reached)
    if goal_drive.progress.given_up is not None:
        hold_reason = f"{goal_drive.progress.given_up}; clear the way or set another goal"
    if drive_request.reached and isinstance(decision, Drive):
        if place is None:
            waits = state.after(drive_request, leg, goal_drive=goal_drive)
            return DriveResult(Drive(STANDSTILL), (), waits, PLACE_LOST)
        drive_request, decision, hold_reason = _at_goal(drive_request, responses, percept, settings, now.map_frame)
        away_m = math.hypot(place.x - percept.pose.x, place.y - percept.pose.y)
        if decision == Drive(STANDSTILL) and away_m > settings.behaviors.move_to_goal.success_radius_m + AWAY_M:
            hold_reason = (
                f"the goal ({drive_request.x:.2f} m, {drive_request.y:.2f} m) was reached, but the robot is "
                f"{away_m:.1f} m from it now: it was moved, or its place was wrong; set the goal again"
            )
    after = state.after(drive_request, leg, goal_drive=goal_drive, trail=trail)
    return DriveResult(decision, with_sum(responses, decision), after, hold_reason)


def _at_goal(
    goal: Goal, responses: tuple[Response, ...], percept: Percept, settings: Settings, map_frame: Pose | None
) -> tuple[Goal, Decision, str | None]:
    """Return the goal, the decision where it is reached, and why the robot stands: it turns to a final heading."""
    if goal.heading is not None and not goal.aligned:
        frame = ODOM_FRAME if goal.frame == "odom" else map_frame
        if frame is None:
            return goal, Drive(STANDSTILL), NO_PLACE
        direction = frame.theta + goal.heading
        if not is_aligned(percept.pose, direction):
            expected = tuple(response.schema for response in responses)
            return goal, _turn_to(direction, responses, expected, percept, settings), None
        goal = replace(goal, aligned=True)
    heading = "" if goal.heading is None else f", heading {math.degrees(goal.heading):.0f}°,"
    return goal, Drive(STANDSTILL), f"the goal ({goal.x:.2f} m, {goal.y:.2f} m){heading} is reached"


def _turn_to(
    direction_rad: float,
    responses: tuple[Response, ...],
    expected: tuple[str, ...],
    percept: Percept,
    settings: Settings,
) -> Decision:
    """Return the arbiter's decision on a turn on the spot to a direction of odometry's frame."""
    behaviors = settings.behaviors
    angle = wrap_angle(direction_rad - percept.pose.theta)
    turning = Twist(0.0, behaviors.arbiter.turn_gain_per_s * angle)
    return limit_velocity(turning, responses, percept, settings.body, behaviors.arbiter, expected)


def _along_legs(state: DriveState, leg: Leg, percept: Percept, settings: Settings, now: Moment) -> DriveResult:
    """Return what the configured legs lead to."""
    ahead, leg = move_ahead(percept, leg, settings.behaviors.move_ahead)
    trail = state.trail
    others: tuple[Response, ...] = ()
    if not leg.done:
        way_rad = math.radians(settings.behaviors.move_ahead.move_ahead_direction_deg)
        way_rad += 0.0 if leg.outbound else math.pi
        others, trail = escape_schemas(percept, way_rad, now.run_s, trail, settings)
    away = avoid_static_obstacle(percept, settings.body.radius_m, settings.behaviors.avoid_static_obstacle)
    responses = (ahead, away, *others)
    expected = (AHEAD, AVOID, *(response.schema for response in others))
    decision = arbitrate(
        responses,
        percept,
        settings.body,
        settings.behaviors.arbiter,
        expected,
        commitment=state.drive_memory.commitment,
        run_s=now.run_s,
    )
    after = state.after(state.drive_request, leg, trail=trail)
    if leg.gave_up and isinstance(decision, Drive):
        return DriveResult(Drive(STANDSTILL), (), after, LEG_GIVEN_UP)
    hold_reason = LEG_DONE if leg.done else None
    return DriveResult(decision, with_sum(responses, decision), after, hold_reason)


def _on_mission(
    state: DriveState, mission: Mission, leg: Leg, percept: Percept, settings: Settings, now: Moment
) -> DriveResult:
    """Return what a mission leads to; where it asks for no motion, or gets none, the result says why."""
    behaviors, body = settings.behaviors, settings.body
    radii_m = {model.name: model.reach_m for model in settings.models}
    scene = Scene(
        percept,
        body,
        behaviors,
        ODOM_FRAME,
        0.0,
        now.cycle_s,
        now.map_frame,
        radii_m=radii_m,
        run_s=now.run_s,
        places=settings.places,
        places_frame=settings.places_frame,
    )
    asked = drive_mission(mission, scene)
    if asked.hold_reason is not None:
        return DriveResult(Drive(STANDSTILL), (), state.after(asked.mission, leg), asked.hold_reason)
    if asked.turn_to_rad is not None:
        responses = (*asked.leads, *asked.helpers)
        decision = _turn_to(asked.turn_to_rad, responses, asked.schemas, percept, settings)
        return DriveResult(decision, with_sum(responses, decision), state.after(asked.mission, leg))
    goal_drive = state.goal_drive if asked.mission.progress.changes == mission.progress.changes else None
    mission, step = asked.mission, asked.mission.step
    step_settings = of_step(step, settings, state.step_settings)
    settings = step_settings.settings
    others = percept if asked.own_echoes is None else replace(percept, obstacles=percept.obstacles[~asked.own_echoes])
    hold_reason, commitment = None, state.drive_memory.commitment
    if asked.goal is not None:
        beside = (r for r in (*asked.leads, *asked.helpers) if r.schema not in {TO_GOAL, VALLEY, CANYON})
        _, goal_drive, responses, decision, hold_reason = drive_to_goal(
            asked.goal,
            goal_drive,
            percept,
            now.run_s,
            tuple(beside),
            settings,
            commitment,
            zone_of_goal(asked.goal, now.zones, settings),
        )
        if goal_drive.progress.fault is not None:
            mission = given_up(mission, goal_drive.progress.fault, goal_drive.progress.given_up or "")
            goal_drive, hold_reason = None, mission.progress.reason or hold_reason
    elif step.gains.get(VALLEY, 0.0) > 0.0:
        remaining_m = math.inf if asked.remaining_m is None else asked.remaining_m
        beside = (r for r in asked.helpers if r.schema != VALLEY)
        goal_drive, responses, decision, hold_reason = drive_through_valley(
            Response(SUM, *summed(asked.leads)),
            remaining_m,
            goal_drive,
            others,
            now.run_s,
            tuple(beside),
            settings,
            commitment,
        )
    else:
        away = avoid_static_obstacle(others, body.radius_m, settings.behaviors.avoid_static_obstacle)
        responses = (*asked.leads, *asked.helpers, away)
        expected = (*asked.schemas, AVOID)
        decision = arbitrate(
            responses, percept, body, behaviors.arbiter, expected, commitment=commitment, run_s=now.run_s
        )
    if hold_reason is None and isinstance(decision, Drive) and decision.twist == STANDSTILL:
        hold_reason = NO_WAY.format(step.name)
    after = state.after(mission, leg, goal_drive=goal_drive, step_settings=step_settings)
    return DriveResult(decision, with_sum(responses, decision), after, hold_reason)


def of_step(step: StepConfig, settings: Settings, before: StepSettings | None) -> StepSettings:
    """Return the settings of a step: those of the cycle before, unless the step or the run's settings are others.

    Parameters
    ----------
    step : StepConfig
        The step that is driven.
    settings : Settings
        The run's.
    before : StepSettings or None
        Of the cycle before.
    """
    if before is not None and before.step is step and before.run is settings:
        return before
    behaviors = settings.behaviors
    to_goal, avoid = behaviors.move_to_goal, behaviors.avoid_static_obstacle
    updates: dict[str, dict[str, float]] = {
        "move_to_goal": {
            "move_to_goal_gain": to_goal.move_to_goal_gain * (1.0 if step.goal is None else step.goal.gain),
            "stuck_after_s": step.stuck_after_s,
            "unreachable_after_s": step.unreachable_after_s,
        },
        "avoid_static_obstacle": {"avoid_obstacle_gain": avoid.avoid_obstacle_gain * step.avoid_gain},
        **{name: {f"{name}_gain": step.gains[name]} for name in (VALLEY, CANYON) if name in step.gains},
    }
    tables = {name: getattr(behaviors, name).model_copy(update=update) for name, update in updates.items()}
    return StepSettings(
        step, settings, settings.model_copy(update={"behaviors": behaviors.model_copy(update=tables)})
    )


def with_sum(responses: tuple[Response, ...], decision: Decision) -> tuple[Response, ...]:
    """Return the responses and, last, their sum; nothing where the decision is a stop, as they may not be finite."""
    if not isinstance(decision, Drive):
        return ()
    return (*responses, Response(SUM, *summed(responses)))
