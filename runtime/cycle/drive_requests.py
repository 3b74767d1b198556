"""Drive requests: the configured legs, a goal, a mission, or a velocity (`runtime.cycle.driving` carries them out).

A drive request alone moves nothing: it takes effect in DRIVE only. Leaving DRIVE drops a goal and an operator's
velocity and holds a mission, so that the robot does not resume them after a re-arm. Without a request the robot
follows the configured legs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Final, Literal, TypeAlias

from pydantic import AfterValidator

from behaviors.memory.goal_place import GOAL_SLEW_M_S, GoalPlace, goal_place
from behaviors.missions.mission import Mission, MissionEdit, continued, edit_refusal, edited, progress_problem
from behaviors.missions.mission import after_stop as mission_after_stop
from behaviors.move_to_goal import Goal
from behaviors.teleoperation import TELEOPERATION_ENDED, Teleoperate
from config.settings import Settings
from drivers.messages import Twist

__all__ = [
    "COORDINATE_MAX_M",
    "GOAL_SLEW_M_S",
    "NO_MAP",
    "STANDSTILL",
    "DriveInput",
    "DriveRequest",
    "GoalPlace",
    "Legs",
    "ValidRequest",
    "after_reboot",
    "after_stop",
    "first_request",
    "goal_place",
    "is_same_drive",
    "needs_map",
    "needs_objects",
    "needs_recognition",
    "needs_space",
    "refusal",
    "requested",
    "validate",
]

STANDSTILL: Final = Twist(0.0, 0.0)
NO_MAP: Final = (
    "there is no map frame for this goal: run with --map FILE or with correction of drift, "
    "or give it in odometry's frame"
)
COORDINATE_MAX_M: Final = 10_000.0
"""Largest coordinate of a goal, m: one beyond it is taken for a typing error."""
HEADING_MAX_RAD: Final = 1e6
"""Largest final heading, rad; any number of turns may be in it."""


@dataclass(frozen=True, slots=True)
class Legs:
    """Follow the configured legs (`behaviors.move_ahead`)."""

    kind: Literal["legs"] = "legs"


DriveRequest: TypeAlias = Legs | Goal | Teleoperate | Mission
"""What is driven in DRIVE."""
ValidRequest: TypeAlias = Annotated[DriveRequest, AfterValidator(lambda request: _refuse_invalid(request))]
"""One that a cycle has accepted: a keyframe that holds another is refused."""
DriveInput: TypeAlias = DriveRequest | MissionEdit
"""What an operator asks for: something else to drive, or a change of the mission under way."""


def first_request(settings: Settings) -> DriveRequest:
    """Return what is driven at the start of a run: the configured mission or goal, otherwise the legs."""
    if settings.mission is not None:
        return Mission(settings.mission)
    goal = settings.goal
    if goal is None:
        return Legs()
    heading = None if goal.heading_deg is None else math.radians(goal.heading_deg)
    return Goal(goal.x_m, goal.y_m, frame=goal.frame, heading=heading)


def needs_map(asked: DriveInput) -> bool:
    """Return whether a request names a place in the map, or waits for the robot's place there to be known."""
    if isinstance(asked, Mission):
        return asked.plan.needs_map
    return isinstance(asked, Goal) and asked.frame == "map"


def needs_objects(drive_request: DriveRequest) -> bool:
    """Return whether a request depends on the objects that are recognised."""
    return isinstance(drive_request, Mission) and drive_request.plan.needs_objects


def needs_space(drive_request: DriveRequest) -> bool:
    """Return whether a request is driven by what is remembered of the space: to a goal, or through valleys."""
    if isinstance(drive_request, Mission):
        step = drive_request.step
        return drive_request.progress.status == "running" and (step.goal is not None or "follow_valley" in step.gains)
    return isinstance(drive_request, Goal)


def needs_recognition(drive_request: DriveRequest) -> bool:
    """Return whether a request waits while recognition is being prepared; what needs no map does not."""
    return needs_map(drive_request) or needs_objects(drive_request) or needs_space(drive_request)


def is_same_drive(before: DriveRequest, after: DriveRequest) -> bool:
    """Return whether an operator's request changes nothing of what is driven now: it is a route's later waypoints."""
    return isinstance(before, Mission) and isinstance(after, Mission) and after.progress is before.progress


def requested(before: DriveRequest, asked: DriveInput) -> DriveRequest:
    """Return what is driven after an operator's request that `refusal` allows.

    `before` is what was driven until then.
    """
    mission = before if isinstance(before, Mission) else None
    if isinstance(asked, MissionEdit):
        return before if mission is None else edited(mission, asked)
    return continued(mission, asked) if mission is not None and isinstance(asked, Mission) else asked


def refusal(before: DriveRequest, asked: DriveInput) -> str | None:
    """Return why a request cannot be carried out, None if it can."""
    if isinstance(asked, MissionEdit):
        return edit_refusal(before if isinstance(before, Mission) else None, asked)
    return validate(asked)


def _refuse_invalid(drive_request: DriveRequest) -> DriveRequest:
    if (problem := validate(drive_request)) is not None:
        raise ValueError(problem)
    return drive_request


def validate(drive_request: DriveRequest) -> str | None:
    """Return why a drive request is invalid, None if it is valid."""
    match drive_request:
        case Goal(x, y, heading=heading):
            if not (abs(x) <= COORDINATE_MAX_M and abs(y) <= COORDINATE_MAX_M):
                return f"invalid goal ({x:g}, {y:g}): expected metres, at most {COORDINATE_MAX_M:g} along each axis"
            if heading is not None and not abs(heading) <= HEADING_MAX_RAD:
                return f"invalid final heading {heading:g}: expected radians, at most {HEADING_MAX_RAD:g}"
        case Teleoperate(v, w, valid_s):
            if not (math.isfinite(v) and math.isfinite(w) and valid_s >= 0.0):
                return (
                    f"invalid velocity ({v:g}, {w:g}) for {valid_s:g} s: "
                    "expected finite m/s and rad/s, duration ≥ 0 s"
                )
        case Mission():
            return progress_problem(drive_request)
    return None


def after_stop(drive_request: DriveRequest, *, bumper: bool = False) -> DriveRequest:
    """Return what remains of a drive request once the robot has left DRIVE: the legs, a mission held, or nothing.

    `bumper`: whether a contact stopped the robot.
    """
    if isinstance(drive_request, Mission):
        return mission_after_stop(drive_request, bumper=bumper)
    return drive_request if isinstance(drive_request, Legs) else TELEOPERATION_ENDED


def after_reboot(drive_request: DriveRequest) -> DriveRequest:
    """Return what remains of a drive request when the odometry has restarted: the legs, or nothing."""
    return drive_request if isinstance(drive_request, Legs) else TELEOPERATION_ENDED
