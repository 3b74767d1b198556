"""A drive to a goal: its valley, its look-ahead and its progress, from one cycle to the next."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Annotated, Final

import numpy as np

from behaviors.arbiter import Decision, Drive, arbitrate
from behaviors.avoid_static_obstacle import SCHEMA as AVOID
from behaviors.avoid_static_obstacle import Zone, avoid_static_obstacle
from behaviors.follow_valley import AT_GOAL_M, Valley, follow_valley
from behaviors.leave_canyon import leave_canyon
from behaviors.memory.commitment import Commitment
from behaviors.memory.detour import NO_DETOUR, Detour
from behaviors.memory.goal_progress import NOTHING_BESIDE, Beside, Progress, observe_progress
from behaviors.move_to_goal import Goal, move_to_goal
from behaviors.response import Response
from behaviors.steady_heading import held
from behaviors.valley.look_ahead import Search, begin, expand
from behaviors.valley.polar_histogram import cells_near
from config.bounded import CONSISTENT, Seconds, Speed
from config.robot import PASSAGE_M
from config.settings import Settings
from perception.percept import Percept, Pose, wrap_angle
from runtime.cycle.drive_requests import STANDSTILL

MOVED_M: Final = 0.1
"""A goal whose place is corrected by more than this needs another way, m."""
FAINT_M: Final = 0.01
"""Least depth of the zone in which avoid-static-obstacle pushes with a bound, m."""
STANDS_S: Final = 5.0
"""Whether there is a valley says nothing of a robot that stands for so much longer than half a turn takes, s."""
ON_THE_SPOT_M: Final = 0.2
TURNS_RAD: Final = math.radians(45.0)
"""A robot so near to where its way begins, and so far off its direction, only turns: the arbiter lets it creep."""
ROUNDS_MAX: Final = 2
"""A detour may lead away from the goal until it has led round what closes the way so often, once on either side."""
NO_VALLEY: Final = "obstacles on all sides: no direction is free"


@dataclass(frozen=True, slots=True)
class GoalDrive:
    """What a drive to a goal keeps from one cycle to the next."""

    progress: Progress
    valley: Valley = field(default_factory=Valley)
    search: Annotated[Search, CONSISTENT] = field(default_factory=Search)
    searched_run_s: Seconds | None = None
    """When the look-ahead began, by the run's clock."""
    turn_rad_s: Speed = 0.0
    """The turning rate that was decided on in the last cycle, rad/s."""
    detour: Detour = NO_DETOUR
    """How leave-canyon has come."""


def drive_to_goal(
    goal: Goal,
    before: GoalDrive | None,
    percept: Percept,
    run_s: float,
    beside: tuple[Response, ...],
    settings: Settings,
    commitment: Commitment | None = None,
    forbidden: str | None = None,
) -> tuple[Goal, GoalDrive, tuple[Response, ...], Decision, str | None]:
    """Return the goal and the drive for the next cycle, the responses, the decision, and why the robot holds.

    Parameters
    ----------
    goal : Goal
        In odometry's frame.
    before : GoalDrive or None
        From the cycle before; None in the first one.
    percept : Percept
        What the robot sees.
    run_s : float
        Now, by the run's clock, s.
    beside : tuple of Response
        Of schemas beside avoid-static-obstacle.
    settings : Settings
        The run's.
    commitment : Commitment, optional
        Of the command before.
    forbidden : str, optional
        The no-go line or area in which the goal lies: it is given up at once.
    """
    distance_m = math.hypot(goal.x - percept.pose.x, goal.y - percept.pose.y)
    now = GoalDrive(Progress.starting_at(percept.pose, distance_m, run_s)) if before is None else before
    if forbidden is not None and now.progress.given_up is None:
        why = f"the goal is unreachable: it lies in or beside {forbidden}"
        now = replace(now, progress=replace(now.progress, given_up=why, fault="unreachable"))
    response, goal = move_to_goal(percept, goal, settings.behaviors.move_to_goal)
    hold_reason, room_m = None, None
    if not goal.reached:
        now, response, hold_reason, room_m = _way_on(response, goal, distance_m, now, percept, run_s, settings)
    responses = (response, _pushes(percept, room_m, settings), *beside)
    decision = _arbitrate(responses, percept, now.turn_rad_s, settings, commitment)
    turn_rad_s = decision.twist.w if isinstance(decision, Drive) else 0.0
    progress = now.progress
    if isinstance(decision, Drive) and not goal.reached:
        progress = observe_progress(
            progress,
            percept.pose,
            distance_m,
            run_s,
            hold_reason,
            settings.behaviors.move_to_goal,
            is_blocked=not now.search.reaches,
            beside=_beside(percept, goal, distance_m, settings),
        )
        if progress.given_up is not None:
            decision, hold_reason = Drive(STANDSTILL), progress.given_up
    return goal, replace(now, progress=progress, turn_rad_s=turn_rad_s), responses, decision, hold_reason


def _way_on(
    straight: Response,
    goal: Goal,
    distance_m: float,
    now: GoalDrive,
    percept: Percept,
    run_s: float,
    settings: Settings,
) -> tuple[GoalDrive, Response, str | None, float | None]:
    """Return the drive, the response on the way, why the robot holds, and the room that this response keeps, m.

    The way is the detour that leave-canyon leads, otherwise a free valley, and without either `straight` to the goal,
    which keeps no room.
    """
    behaviors = settings.behaviors
    if behaviors.leave_canyon.leave_canyon_gain > 0.0:
        now, around = _with_detour(now, goal, percept, run_s, settings)
        if around is not None:
            length, direction_rad = math.hypot(around.x, around.y), math.atan2(around.y, around.x)
            driven_rad = held(percept.pose.theta, direction_rad)
            response = Response(around.schema, length * math.cos(driven_rad), length * math.sin(driven_rad))
            progress = now.progress
            if now.detour.rounds < ROUNDS_MAX:
                progress = replace(progress, excused_run_s=run_s)
            valley = Valley(now.valley.blocked, direction_rad)
            return replace(now, progress=progress, valley=valley), response, None, behaviors.leave_canyon.room_m
    if behaviors.follow_valley.follow_valley_gain > 0.0:
        now = _with_search(now, goal, percept, run_s, settings)
        response, valley = follow_valley(
            percept, straight, distance_m, now.valley, now.search, settings.body.radius_m, behaviors.follow_valley
        )
        hold_reason = NO_VALLEY if valley.direction_rad is None else None
        return replace(now, valley=valley), response, hold_reason, behaviors.follow_valley.safety_m
    return now, straight, None, None


def _with_detour(
    now: GoalDrive, goal: Goal, percept: Percept, run_s: float, settings: Settings
) -> tuple[GoalDrive, Response | None]:
    """Return the drive, and the way that leave-canyon leads; None while it leads none."""
    behaviors, body = settings.behaviors, settings.body
    has_valley = behaviors.follow_valley.follow_valley_gain > 0.0 and now.valley.direction_rad is not None
    stands_s = STANDS_S + math.pi / min(behaviors.move_to_goal.turn_rate_max_rad_s, body.turn_max_rad_s)
    stood_s = run_s - now.progress.moved_run_s
    around, detour = leave_canyon(
        percept,
        (goal.x, goal.y),
        now.detour,
        body.radius_m,
        behaviors.leave_canyon,
        waits=has_valley and stood_s < stands_s,
        last_rad=now.valley.direction_rad,
    )
    progress = now.progress
    # A detour for a robot that stands gets its own time to turn before that robot counts as stuck.
    if now.detour.side == 0 != detour.side and stood_s >= stands_s:
        progress = replace(progress, moved_run_s=run_s)
    return replace(now, progress=progress, detour=detour), around


def drive_through_valley(
    way: Response,
    distance_m: float,
    before: GoalDrive | None,
    percept: Percept,
    run_s: float,
    beside: tuple[Response, ...],
    settings: Settings,
    commitment: Commitment | None = None,
) -> tuple[GoalDrive, tuple[Response, ...], Decision, str | None]:
    """Return the drive for the next cycle, the responses, the decision, and why the robot holds, without a goal.

    Parameters
    ----------
    way : Response
        Where other schemas lead; the robot takes the free valley nearest to it.
    distance_m : float
        How far it is to where they lead, m; infinite if they lead nowhere in particular.
    beside : tuple of Response
        Of other schemas.
    before, percept, run_s, settings, commitment
        As of `drive_to_goal`.
    """
    now = GoalDrive(Progress.starting_at(percept.pose, 0.0, run_s)) if before is None else before
    config, radius_m = settings.behaviors.follow_valley, settings.body.radius_m
    response, valley = follow_valley(percept, way, distance_m, now.valley, Search(), radius_m, config)
    responses = (response, _pushes(percept, config.safety_m, settings), *beside)
    expected = tuple(r.schema for r in responses)
    decision = arbitrate(
        responses, percept, settings.body, settings.behaviors.arbiter, expected, commitment=commitment, run_s=run_s
    )
    is_closed = valley.direction_rad is None and math.hypot(way.x, way.y) > 0.0
    return replace(now, valley=valley), responses, decision, NO_VALLEY if is_closed else None


def _arbitrate(
    responses: tuple[Response, ...],
    percept: Percept,
    last_rad_s: float,
    settings: Settings,
    commitment: Commitment | None,
) -> Decision:
    """Return the arbiter's decision for a robot that turns no faster than it should on its way, and steadily.

    One that is pushed turns away as fast as its base can, and one that has looked to its blind sides turns back so.
    """
    config, expected = settings.behaviors.move_to_goal, tuple(r.schema for r in responses)
    rate_rad_s = config.turn_rate_max_rad_s
    change_rad_s = config.turn_acceleration_max_rad_s2 / settings.cycle.rate_hz
    if any(r.schema == AVOID and (r.x, r.y) != (0.0, 0.0) for r in responses):
        change_rad_s = math.inf
    if abs(last_rad_s) > rate_rad_s:  # it has looked to its blind sides: it turns back as fast
        rate_rad_s = change_rad_s = math.inf
    limits = max(-rate_rad_s, last_rad_s - change_rad_s), min(rate_rad_s, last_rad_s + change_rad_s)
    return arbitrate(responses, percept, settings.body, settings.behaviors.arbiter, expected, limits, commitment)


def _beside(percept: Percept, goal: Goal, distance_m: float, settings: Settings) -> Beside:
    """Return what surely stands nearest to the goal, which the robot is near, or the no-go line there."""
    body_m = settings.body.radius_m
    needed_m = body_m + _margin_m(settings)
    if distance_m >= AT_GOAL_M:
        return NOTHING_BESIDE
    there = cells_near(percept, goal.x, goal.y, needed_m, settings.behaviors.follow_valley)
    away_m = float(there.distances[there.certainties == 1.0].min(initial=math.inf))
    lines = percept.obstacles[len(percept.obstacles) - percept.no_go :].reshape(-1, 2)
    line_m = float(np.hypot(lines[:, 0] - goal.x, lines[:, 1] - goal.y).min(initial=math.inf))
    # A no-go line also fills the cells of the grid that it crosses, whose middles may lie nearer to the goal.
    cell_m = 0.0 if percept.occupancy is None else percept.occupancy.cell_m
    if line_m < math.inf and line_m <= 1e-9 + away_m + math.sqrt(0.5) * cell_m:
        return Beside(line_m, body_m, needed_m, is_line=True)
    return Beside(away_m, body_m, needed_m)


def _margin_m(settings: Settings) -> float:
    """Return what the arbiter keeps to all that is passed, m."""
    return min(settings.behaviors.arbiter.clearance_m, PASSAGE_M)


def _pushes(percept: Percept, room_m: float | None, settings: Settings) -> Response:
    """Return avoid-static-obstacle's response, by itself or beside a schema that keeps `room_m` itself.

    Beside one, it pushes the robot out of that room, and without bound out of what the arbiter keeps to all that is
    passed.
    """
    zone, margin_m = None, _margin_m(settings)
    if room_m is not None:
        zone = Zone(max(room_m, margin_m + FAINT_M), margin_m)
    return avoid_static_obstacle(percept, settings.body.radius_m, settings.behaviors.avoid_static_obstacle, zone)


def _with_search(now: GoalDrive, goal: Goal, percept: Percept, run_s: float, settings: Settings) -> GoalDrive:
    """Return the drive with a look-ahead that has just started, where one is due."""
    config, search, place = settings.behaviors.follow_valley, now.search, (goal.x, goal.y)
    if not all(map(math.isfinite, (percept.pose.x, percept.pose.y, percept.pose.theta, *place))):
        return now
    if config.look_ahead_nodes_max == 0:
        return now
    if search.goal is not None and math.dist(search.goal, place) > MOVED_M:
        return replace(now, search=begin(search, percept, place), searched_run_s=run_s)
    age_s = math.inf if now.searched_run_s is None else run_s - now.searched_run_s
    if run_s - now.progress.moved_run_s > STANDS_S and _turns_to_way(now, percept.pose):
        # The turn gets its own time before the robot counts as stuck.
        return replace(now, progress=replace(now.progress, moved_run_s=run_s - STANDS_S))
    if search.is_done and age_s >= config.look_ahead_period_s:
        return replace(now, search=begin(search, percept, place), searched_run_s=run_s)
    return now


def _turns_to_way(now: GoalDrive, pose: Pose) -> bool:
    """Return whether the robot turns on the spot to the way in force: another one would turn it to and fro there."""
    direction, way = now.valley.direction_rad, now.search.way
    if direction is None or not way or math.dist(way[0], (pose.x, pose.y)) > ON_THE_SPOT_M:
        return False
    return abs(wrap_angle(direction - pose.theta)) > TURNS_RAD


def can_look_ahead(now: GoalDrive | None, percept: Percept | None) -> bool:
    """Return whether a quantum of the look-ahead would find anything."""
    return now is not None and percept is not None and not now.search.is_done and now.progress.given_up is None


def look_ahead(now: GoalDrive | None, percept: Percept | None, settings: Settings) -> GoalDrive | None:
    """Return the drive after a quantum of its look-ahead, if there is one."""
    if now is None or percept is None:
        return now
    return replace(now, search=expand(now.search, percept, settings.body.radius_m, settings.behaviors.follow_valley))
