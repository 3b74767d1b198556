"""What the operator wants driven, and which schemas are asked for it.

A drive_request moves nothing by itself: it is looked at in DRIVE only. Leaving DRIVE takes a goal and the hand from the stick
away, so that nothing goes on by itself after a re-arm; the legs of the settings are what a robot drives that nobody
told anything.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

from behaviors.arbiter import Decision, Drive, arbitrate, limit_velocity
from behaviors.avoid_static_obstacle import SCHEMA as AVOID
from behaviors.avoid_static_obstacle import avoid_static_obstacle
from behaviors.move_ahead import SCHEMA as AHEAD
from behaviors.move_ahead import Leg, move_ahead
from behaviors.move_to_goal import SCHEMA as TO_GOAL
from behaviors.move_to_goal import Goal, move_to_goal
from behaviors.response import Response
from behaviors.teleoperation import SCHEMA as BY_HAND
from behaviors.teleoperation import TELEOPERATION_ENDED, Teleoperate, is_expired, teleoperation
from config.settings import Settings
from drivers.messages import Twist
from perception.percept import Percept

STANDSTILL: Final = Twist(0.0, 0.0)
COORDINATE_MAX_M: Final = 10_000.0
"""A goal farther off than this along an axis is a slip of the pen; nobody drives ten kilometres by sonar."""
SUM: Final = "sum"


@dataclass(frozen=True, slots=True)
class Legs:
    """Ahead, as `behaviors.move_ahead` is set."""

    kind: Literal["legs"] = "legs"


DriveRequest: TypeAlias = Legs | Goal | Teleoperate


@dataclass(frozen=True, slots=True)
class DriveResult:
    """What came of a drive_request in one cycle."""

    decision: Decision
    vectors: tuple[Response, ...]
    """What the schemas answered, and their sum, named so."""
    drive_request: DriveRequest
    """As it stands now: a goal may be reached, a hand gone."""
    leg: Leg
    standing: str | None = None
    """Why the robot stands though it may drive; a text for the operator."""


def validate(drive_request: DriveRequest) -> str | None:
    """Return why a drive_request is none, None where it is good."""
    match drive_request:
        case Goal(x, y):
            if not (abs(x) <= COORDINATE_MAX_M and abs(y) <= COORDINATE_MAX_M):
                return f"the goal ({x:g}, {y:g}) is no place: give metres in the odometry's frame"
        case Teleoperate(v, w, valid_s):
            if not (math.isfinite(v) and math.isfinite(w) and valid_s >= 0.0):
                return f"the velocity ({v:g}, {w:g}) for {valid_s:g} s is none: give m/s, rad/s and seconds"
    return None


def after_a_stop(drive_request: DriveRequest) -> DriveRequest:
    """Return what is left of a drive_request once the robot has stopped driving: the legs, or nothing."""
    return drive_request if isinstance(drive_request, Legs) else TELEOPERATION_ENDED


def drive(
    drive_request: DriveRequest, requested_run_s: float, run_s: float, leg: Leg, percept: Percept, settings: Settings
) -> DriveResult:
    """Ask the schemas that the drive_request names, and the arbiter.

    Parameters
    ----------
    drive_request : DriveRequest
        What is wanted.
    requested_run_s, run_s : float
        When that was said, and now, by the run's clock.
    leg : Leg
        The way under way, for `Legs`.
    percept : Percept
        What the robot sees.
    settings : Settings
        The run's.
    """
    behaviors, body = settings.behaviors, settings.body
    away = avoid_static_obstacle(percept, body.radius_m, behaviors.avoid_static_obstacle)
    if isinstance(drive_request, Teleoperate):
        # Of the cycles that are in time the last one is to stop: the next one would be late.
        age_s = run_s - requested_run_s
        if drive_request != TELEOPERATION_ENDED and is_expired(
            drive_request, age_s + 1.0 / settings.cycle.rate_hz, behaviors.teleoperation
        ):
            drive_request = TELEOPERATION_ENDED
        hand = teleoperation(percept, drive_request, behaviors.arbiter.base_velocity_m_s)
        both = behaviors.teleoperation.avoid
        responses, expected = ((hand, away), (BY_HAND, AVOID)) if both else ((hand,), (BY_HAND,))
        decision = limit_velocity(
            Twist(drive_request.v, drive_request.w), responses, percept, body, behaviors.arbiter, expected
        )
        nobody = "nobody is at the controls: drive by hand, name a goal, or go on with the legs"
        return DriveResult(
            decision,
            shown(responses, decision),
            drive_request,
            leg,
            nobody if drive_request == TELEOPERATION_ENDED else None,
        )
    if isinstance(drive_request, Goal):
        to_goal, drive_request = move_to_goal(percept, drive_request, behaviors.move_to_goal)
        responses = (to_goal, away)
        decision = arbitrate(responses, percept, body, behaviors.arbiter, (TO_GOAL, AVOID))
        if drive_request.reached and isinstance(decision, Drive):
            there = f"the goal ({drive_request.x:.2f} m, {drive_request.y:.2f} m) is reached"
            return DriveResult(Drive(STANDSTILL), shown(responses, decision), drive_request, leg, there)
        return DriveResult(decision, shown(responses, decision), drive_request, leg)
    ahead, leg = move_ahead(percept, leg, behaviors.move_ahead)
    decision = arbitrate((ahead, away), percept, body, behaviors.arbiter, (AHEAD, AVOID))
    standing = "the leg is done" if leg.done else None
    return DriveResult(decision, shown((ahead, away), decision), drive_request, leg, standing)


def shown(responses: tuple[Response, ...], decision: Decision) -> tuple[Response, ...]:
    """Return the responses and, last, their sum; nothing where they allowed no decision and may be no vectors."""
    if not isinstance(decision, Drive):
        return ()
    return (*responses, Response(SUM, sum(r.x for r in responses), sum(r.y for r in responses)))
