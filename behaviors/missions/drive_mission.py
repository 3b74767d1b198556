"""One cycle of a mission: the answers of the step's schemas, its conditions, and why it stands where it does.

The order is fixed: time and way are counted, the schemas answer, the first condition that holds leads on, and the
step that is then in force answers. A step that comes no nearer to its end for too long is stuck: it is held with the
reason, or goes where its condition `stuck` leads. So a mission never stands without a reason.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from behaviors.approach_object import matching
from behaviors.memory.goal_progress import Fault
from behaviors.memory.way_progress import GROUND_M, NEARER_M
from behaviors.missions.mission import VISITED_MAX, Mission, Progress, goes_to, held
from behaviors.move_to_goal import Goal
from behaviors.response import Response
from behaviors.schema_call import Answer, Memory, Scene, Visited
from behaviors.schema_registry import schema_of
from config.mission_step import Condition, SeenCondition, UnseenCondition
from config.schema_use import SchemaUse
from perception.percept import Pose

TURNED_RAD: Final = 0.1
"""Turning by less than this is no progress of a turn, rad."""


@dataclass(frozen=True, slots=True)
class MissionDrive:
    """What a mission asks for in one cycle."""

    mission: Mission
    """After the cycle."""
    leads: tuple[Response, ...] = ()
    """Of the step's schemas that lead somewhere; empty where the robot is to stand."""
    helpers: tuple[Response, ...] = ()
    """Of those that lead nowhere by themselves."""
    goal: Goal | None = None
    """The place to which the robot is to drive as to any goal, in place of `leads`."""
    remaining_m: float | None = None
    """How far it still is, m; None if the step leads nowhere in particular."""
    turn_to_rad: float | None = None
    """The direction to which the robot is to turn on the spot, in place of the responses."""
    own_echoes: NDArray[np.bool_] | None = None
    """Obstacles from which the schemas keep their distance themselves."""
    hold_reason: str | None = None
    """Why the robot is to stand, for the operator; None if it is to move."""

    @property
    def schemas(self) -> tuple[str, ...]:
        """Names of the schemas that must have responded."""
        return tuple(use.name for use in self.mission.step.schemas)


def drive_mission(mission: Mission, scene: Scene) -> MissionDrive:
    """Return what the mission asks for, and the mission after this cycle.

    Parameters
    ----------
    mission
        The mission so far.
    scene
        What the robot sees; its `start`, `step_s` and `visited` are filled in here.
    """
    if mission.progress.status != "running":
        return MissionDrive(mission, hold_reason=mission.progress.reason)
    mission = _counted(mission, scene)
    mission, answers = _with_answers(mission, scene)
    mission = _watched(mission, scene, answers)
    condition = next((c for i, c in enumerate(mission.step.conditions) if _holds(c, i, mission, answers)), None)
    if condition is not None:
        mission = goes_to(mission, condition.go, f"{condition.when} in its step {mission.step.name}")
        if mission.progress.status == "running":
            mission, answers = _with_answers(_counted(mission, replace(scene, cycle_s=0.0)), scene)
    elif is_stuck(mission):
        mission = held(mission, _stuck_reason(mission, answers))
    if mission.progress.status != "running":
        return MissionDrive(mission, hold_reason=mission.progress.reason)
    turn_to_rad = next((answer.turn_to_rad for answer in answers if answer.turn_to_rad is not None), None)
    if _is_waiting(mission, answers):
        return MissionDrive(mission, hold_reason=_waiting_reason(mission, answers))
    own = [answer.own_echoes for answer in answers if answer.own_echoes is not None]
    named = [(not use.leads, answer.response) for use, answer in _named(mission, answers)]
    return MissionDrive(
        mission,
        tuple(response for helps, response in named if not helps),
        tuple(response for helps, response in named if helps),
        _goal(answers),
        _remaining_m(answers),
        turn_to_rad,
        np.logical_or.reduce(own) if own else None,
    )


def given_up(mission: Mission, fault: Fault, why: str) -> Mission:
    """Return the mission after the drive to its step's goal was given up.

    It goes where the condition of that fault leads, or without one is held. An unreachable goal is a stuck step
    where only that has a condition.

    Parameters
    ----------
    mission
        The mission, in a step with a goal.
    fault
        Why the goal was given up.
    why
        The same for the operator.
    """
    faults = (fault, "stuck")
    found = [c for when in faults for c in mission.step.conditions if c.when == when]
    if not found:
        reason = f"step {mission.step.name}: {why}; clear the way and resume the mission, or skip the step"
        return held(mission, reason)
    return goes_to(mission, found[0].go, f"{fault} in its step {mission.step.name}")


def is_stuck(mission: Mission) -> bool:
    """Return whether the step has made no progress for too long."""
    progress = mission.progress
    return progress.step_s - progress.best_s >= mission.step.stuck_after_s


def _counted(mission: Mission, scene: Scene) -> Mission:
    """Return the mission with this cycle's time and way; a step that begins starts from here."""
    progress, pose = mission.progress, scene.percept.pose
    if progress.start is None:
        fresh = tuple(Memory() for _ in mission.step.schemas)
        seen_s = tuple(0.0 for _ in mission.step.conditions)
        progress = replace(progress, start=pose, last=pose, anchor=pose, memories=fresh, seen_s=seen_s)
    step_s, last = progress.step_s + scene.cycle_s, progress.last or pose
    lost_s = 0.0 if scene.map_frame is not None else progress.lost_s + scene.cycle_s
    seen_s = tuple(
        step_s if _is_seen(condition, scene, progress.visited) else before_s
        for condition, before_s in zip(mission.step.conditions, progress.seen_s, strict=True)
    )
    way_m = progress.way_m + math.hypot(pose.x - last.x, pose.y - last.y)
    progress = replace(progress, step_s=step_s, way_m=way_m, last=pose, lost_s=lost_s, seen_s=seen_s)
    return replace(mission, progress=progress)


def _with_answers(mission: Mission, scene: Scene) -> tuple[Mission, tuple[Answer, ...]]:
    """Return the mission with what its step's schemas keep, and their answers in the order of the step's schemas.

    Those that lead are called first; the others get the direction in which they lead (`Scene.way_rad`).
    """
    progress = mission.progress
    scene = replace(
        scene, start=progress.start or scene.percept.pose, step_s=progress.step_s, visited=progress.visited
    )
    used = list(zip(mission.step.schemas, progress.memories, strict=True))
    leads = [schema_of(use)(scene, memory, use) for use, memory in used if use.leads]
    scene = replace(scene, way_rad=_way_rad(leads, scene.percept.pose))
    rest = iter(leads)
    answers = tuple(schema_of(use)(scene, memory, use) if not use.leads else next(rest) for use, memory in used)
    visited: tuple[Visited, ...] = tuple(
        answer.visited for answer in answers if answer.visited is not None and answer.visited not in progress.visited
    )
    memories = tuple(answer.memory for answer in answers)
    progress = replace(progress, memories=memories, visited=(progress.visited + visited)[-VISITED_MAX:])
    return replace(mission, progress=progress), answers


def _watched(mission: Mission, scene: Scene, answers: tuple[Answer, ...]) -> Mission:
    """Return the mission with its progress noted; a step that waits for something makes it by waiting."""
    progress, pose = mission.progress, scene.percept.pose
    remaining_m, anchor = _remaining_m(answers), progress.anchor or pose
    if _is_waiting(mission, answers) or _goal(answers) is not None:  # the drive to the goal knows its own progress
        has_moved = True
    elif remaining_m is None or remaining_m == 0.0:  # nowhere in particular, or only a turn is left
        turned = abs(math.remainder(pose.theta - anchor.theta, math.tau))
        ground_m = GROUND_M if remaining_m is None else NEARER_M
        has_moved = math.hypot(pose.x - anchor.x, pose.y - anchor.y) >= ground_m
        has_moved |= remaining_m == 0.0 and turned >= TURNED_RAD
    else:
        has_moved = progress.best_m is None or remaining_m <= progress.best_m - NEARER_M
    if not has_moved:
        return mission if progress.anchor is not None else _with_anchor(mission, progress, scene)
    progress = replace(progress, best_m=remaining_m, best_s=progress.step_s)
    return _with_anchor(mission, progress, scene)


def _is_waiting(mission: Mission, answers: tuple[Answer, ...]) -> bool:
    """Return whether the schemas that lead somewhere all ask for no motion; others alone do not."""
    leads = [answer for use, answer in _named(mission, answers) if use.leads]
    return all(answer.waits_for is not None for answer in leads) if leads else not answers


def _named(mission: Mission, answers: tuple[Answer, ...]) -> list[tuple[SchemaUse, Answer]]:
    """Return the step's schemas with their answers."""
    return list(zip(mission.step.schemas, answers, strict=True))


def _goal(answers: tuple[Answer, ...]) -> Goal | None:
    """Return the place to which the step drives as to any goal."""
    return next((answer.goal for answer in answers if answer.goal is not None), None)


def _remaining_m(answers: tuple[Answer, ...]) -> float | None:
    """Return the least distance left to where a schema leads, m; None if none leads to a place."""
    return min((answer.remaining_m for answer in answers if answer.remaining_m is not None), default=None)


def _way_rad(leads: list[Answer], pose: Pose) -> float | None:
    """Return the direction in which the schemas lead together, rad in odometry's frame; None if in none."""
    goal = _goal(tuple(leads))
    if goal is not None:
        return math.atan2(goal.y - pose.y, goal.x - pose.x)
    x, y = sum(lead.response.x for lead in leads), sum(lead.response.y for lead in leads)
    return None if x == y == 0.0 else math.atan2(y, x)


def _with_anchor(mission: Mission, progress: Progress, scene: Scene) -> Mission:
    return replace(mission, progress=replace(progress, anchor=scene.percept.pose))


def _is_seen(condition: Condition, scene: Scene, visited: tuple[Visited, ...]) -> bool:
    """Return whether the object that a condition looks for is seen; False for other conditions."""
    if not isinstance(condition, SeenCondition | UnseenCondition):
        return False
    left_out = visited if condition.unvisited else ()
    found = matching(scene.percept.objects, condition.object, condition.probability_min, left_out)
    if isinstance(condition, UnseenCondition) or condition.within_m is None:
        return bool(found)
    pose = scene.percept.pose
    return any(math.hypot(seen.x - pose.x, seen.y - pose.y) <= condition.within_m for seen in found)


def _holds(condition: Condition, number: int, mission: Mission, answers: tuple[Answer, ...]) -> bool:
    """Return whether a condition of the step holds; a contact's is looked at when it stops the robot."""
    progress = mission.progress
    match condition.when:
        case "reached":
            return any(answer.has_arrived for answer in answers)
        case "seen":
            return progress.seen_s[number] == progress.step_s and progress.step_s > 0.0
        case "unseen":
            return progress.step_s - progress.seen_s[number] >= condition.after_s
        case "time":
            return progress.step_s >= condition.after_s
        case "way":
            return progress.way_m >= condition.after_m
        case "lost":
            return progress.lost_s >= condition.after_s
        case "stuck":
            return is_stuck(mission)
        case _:
            return False


def _waiting_reason(mission: Mission, answers: tuple[Answer, ...]) -> str:
    """Return why a step asks for no motion: what its schemas wait for, or its conditions where it has no schema."""
    step, progress = mission.step, mission.progress
    if waits := [answer.waits_for for answer in answers if answer.waits_for is not None]:
        return f"step {step.name}: {'; '.join(waits)}"
    return f"step {step.name} waits for: {', '.join(_left(c, progress) for c in step.conditions)}"


def _left(condition: Condition, progress: Progress) -> str:
    """Return a condition in words, with what is left of it."""
    match condition.when:
        case "time":
            return f"time, {max(0.0, condition.after_s - progress.step_s):.0f} s more"
        case "way":
            return f"way, {max(0.0, condition.after_m - progress.way_m):.1f} m more"
        case "seen" | "unseen":
            return f"{condition.object} {condition.when}"
        case _:
            return condition.when


def _stuck_reason(mission: Mission, answers: tuple[Answer, ...]) -> str:
    step, progress = mission.step, mission.progress
    left_m = _remaining_m(answers)
    where = f"after {progress.way_m:.1f} m" if left_m is None else f"{left_m:.1f} m before its end"
    return (
        f"step {step.name} is stuck {where}: it has come no nearer for {step.stuck_after_s:g} s, as something is in "
        "the way; clear the way and resume the mission, or skip the step"
    )
