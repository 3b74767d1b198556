"""A mission under way: what is to be done, how far it has come, and what an operator or a stop does to it.

A mission is a value. It moves nothing by itself: each cycle in which the robot may drive passes it through
`behaviors.missions.drive_mission`. A stop holds it, and only a resume lets it go on.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Final, Literal, TypeAlias

from behaviors.schema_call import Memory, Visited
from config.mission import MissionConfig, StepConfig
from config.mission_step import DONE, FAILED, HOLD, NEXT, Frame, ReachedCondition
from config.route import Waypoint, route_config
from perception.percept import Pose

VISITED_MAX: Final = 256
"""Objects at which a mission remembers to have arrived; beyond that it forgets the first ones."""
NUMBER_MAX: Final = 1e9
"""Greatest number in a mission's progress: m, rad, s, or a count."""
ROUTE: Final = "route"
"""Name of the mission that the waypoints of an operator are."""

HELD_BY_OPERATOR: Final = "the mission is held by the operator: resume it, or skip the step"
HELD_BY_STOP: Final = "the robot was stopped, so the mission is held: resume it once the robot is armed"
HELD_BY_CONDITION: Final = "the mission waits for the operator, as its step {} says: resume it, or skip the step"

Status: TypeAlias = Literal["running", "held", "done", "failed"]


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a mission has come."""

    step: int = 0
    """Number of the step; of the last one that was driven, once the mission has ended."""
    status: Status = "running"
    reason: str | None = None
    """Why it is held or has ended, for the operator; None while it runs."""
    start: Pose | None = None
    """The robot's pose as the step began, in odometry's frame; None until it is driven."""
    last: Pose | None = None
    """The pose in the last cycle that drove it."""
    step_s: float = 0.0
    """How long the step has been driven, s."""
    way_m: float = 0.0
    """Way that the robot has come in the step, m."""
    best_m: float | None = None
    """Least distance left to where the schemas lead, m; None if they lead nowhere in particular."""
    best_s: float = 0.0
    """Time in the step when that last shrank, or when the robot last got away from `anchor`."""
    anchor: Pose | None = None
    """Where it was then."""
    lost_s: float = 0.0
    """How long the robot has not known its place in the map, s."""
    seen_s: tuple[float, ...] = ()
    """Time in the step at which each condition's object was last seen, by the condition's number."""
    memories: tuple[Memory, ...] = ()
    """Of the step's schemas, in their order."""
    visited: tuple[Visited, ...] = ()
    """Objects at which steps have arrived, oldest first."""
    changes: int = 0
    """Steps that have ended so far."""


@dataclass(frozen=True, slots=True)
class Mission:
    """A mission as a drive request."""

    plan: MissionConfig
    progress: Progress = field(default_factory=Progress)
    kind: Literal["mission"] = "mission"

    @property
    def step(self) -> StepConfig:
        """The step that is driven, or was last."""
        return self.plan.step[self.progress.step]


@dataclass(frozen=True, slots=True)
class MissionEdit:
    """A change of the mission under way that an operator asks for."""

    action: Literal["hold", "resume", "skip"]
    kind: Literal["mission_edit"] = "mission_edit"


def goes_to(mission: Mission, target: str, why: str) -> Mission:
    """Return the mission after a condition has led to a target.

    Parameters
    ----------
    mission
        The mission so far.
    target
        A step's name, or one of `config.mission_step.TARGETS`.
    why
        What led there, for the operator.
    """
    progress, plan = mission.progress, mission.plan
    if target == HOLD:
        reason = HELD_BY_CONDITION.format(mission.step.name)
        # Resumed, it goes on with the next step: the condition that led here would hold again at once.
        following = plan.index(NEXT, progress.step)
        if following is None:
            return _ended(mission, DONE, why)
        return replace(mission, progress=replace(_begin(progress, following), status="held", reason=reason))
    index = plan.index(target, progress.step)
    if index is None:
        return _ended(mission, FAILED if target == FAILED else DONE, why)
    return replace(mission, progress=_begin(progress, index))


def held(mission: Mission, reason: str) -> Mission:
    """Return a mission that waits for the operator, if it runs."""
    if mission.progress.status != "running":
        return mission
    return replace(mission, progress=replace(mission.progress, status="held", reason=reason))


def after_stop(mission: Mission, *, bumper: bool) -> Mission:
    """Return a mission after the robot has left DRIVE: held, at the step that its condition on a contact names.

    Where that condition leads to no further step, the mission ends. One that does not run is returned unchanged.

    Parameters
    ----------
    mission
        The mission so far.
    bumper
        Whether a contact stopped the robot.
    """
    if mission.progress.status != "running":
        return mission
    led_to = next((c.go for c in mission.step.conditions if c.when == "bumper"), None) if bumper else None
    if led_to is not None:
        mission = goes_to(mission, led_to, "a contact stopped the robot")
    return held(mission, HELD_BY_STOP)


def edited(mission: Mission, edit: MissionEdit) -> Mission:
    """Return the mission after an operator's edit that `edit_refusal` allows."""
    progress = mission.progress
    if edit.action == "hold":
        return held(mission, HELD_BY_OPERATOR)
    if edit.action == "resume":
        # The time without progress counts anew, and what was driven meanwhile is no way of the step.
        progress = replace(progress, status="running", reason=None, last=None, best_s=progress.step_s, best_m=None)
        return replace(mission, progress=replace(progress, anchor=None))
    reached = next((c.go for c in mission.step.conditions if isinstance(c, ReachedCondition)), NEXT)
    after = goes_to(mission, reached, "the operator skipped the last step")
    if progress.status == "held" and after.progress.status == "running":
        return replace(after, progress=replace(after.progress, status="held", reason=progress.reason))
    return after


def edit_refusal(mission: Mission | None, edit: MissionEdit) -> str | None:
    """Return why an edit is impossible, None if it can be carried out."""
    if mission is None:
        return f"there is no mission to {edit.action}: start one, or set waypoints"
    progress = mission.progress
    if progress.status in {"done", "failed"}:
        return f"the mission {mission.plan.name} has ended ({progress.status}): start it again"
    if edit.action == "resume" and progress.status == "running":
        return f"the mission {mission.plan.name} is not held"
    return None


def continued(before: Mission, after: Mission) -> Mission:
    """Return a new route with the progress of the one before, if that is the same as far as it is behind the robot.

    So a route whose further waypoints an operator adds, moves or removes goes on without a stop. One whose present
    waypoint is moved or removed goes on from there. Another mission begins anew.
    """
    progress, at = before.progress, before.progress.step
    if progress.status == "failed" or {before.plan.name, after.plan.name} != {ROUTE}:
        return after
    behind = at + 1 if progress.status == "done" else at
    if after.plan.step[:behind] != before.plan.step[:behind]:
        return after
    if len(after.plan.step) == behind:
        if progress.status == "done":
            return after
        return _ended(replace(after, progress=_begin(progress, at - 1)), DONE, "the operator removed what was left")
    if behind == at and after.plan.step[at] == before.plan.step[at]:
        return replace(after, progress=progress)
    fresh = _begin(progress, behind)
    if progress.status == "held":
        fresh = replace(fresh, status="held", reason=progress.reason)
    return replace(after, progress=fresh)


def route(waypoints: tuple[Waypoint, ...], frame: Frame) -> Mission:
    """Return the mission of driving to places in turn.

    Parameters
    ----------
    waypoints
        Each place x, y, m, and the final heading there in degrees, None for any.
    frame
        The frame of all of them.
    """
    return Mission(route_config(waypoints, frame, ROUTE))


def _numbers(progress: Progress) -> Iterator[float]:
    """Yield the numbers of a mission's progress that a check bounds: a recording may hold any."""
    poses = [pose for pose in (progress.start, progress.last, progress.anchor) if pose is not None]
    yield from (n for pose in poses for n in (pose.x, pose.y, pose.theta))
    for memory in progress.memories:
        yield from (memory.index, memory.x, memory.y, memory.since_s)
        yield from (n for place in memory.trail for n in place)
    yield from (n for visited in progress.visited for n in (visited.x, visited.y))
    yield from (progress.step_s, progress.way_m, progress.best_m or 0.0, progress.best_s, progress.lost_s)
    yield from progress.seen_s


def progress_problem(mission: Mission) -> str | None:
    """Return why a mission's progress does not belong to its plan, None if it does; a recording may hold anything."""
    progress = mission.progress
    if not 0 <= progress.step < len(mission.plan.step):
        return f"invalid mission: its step is {progress.step}, expected one of {len(mission.plan.step)}"
    if not all(abs(number) <= NUMBER_MAX for number in _numbers(progress)):  # also refuses NaN
        return f"invalid mission: a number of its progress is not within ±{NUMBER_MAX:g}"
    if min((memory.index for memory in progress.memories), default=0) < 0 or len(progress.visited) > VISITED_MAX:
        return "invalid mission: a count of its progress is out of range"
    step = mission.step
    has_started = (len(progress.memories), len(progress.seen_s)) == (len(step.schemas), len(step.conditions))
    if progress.start is not None and not has_started:
        return f"invalid mission: its progress is not that of its step {step.name}"
    return None


def _begin(progress: Progress, step: int) -> Progress:
    """Return the progress at the beginning of a step; what has been visited is kept."""
    return Progress(step, visited=progress.visited, lost_s=progress.lost_s, changes=progress.changes + 1)


def _ended(mission: Mission, status: Literal["done", "failed"], why: str) -> Mission:
    reason = f"the mission {mission.plan.name} " + (f"is done: {why}" if status == DONE else f"has failed: {why}")
    progress = replace(mission.progress, status=status, reason=reason, changes=mission.progress.changes + 1)
    return replace(mission, progress=progress)
