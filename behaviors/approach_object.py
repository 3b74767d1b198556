"""The approach-object schema: docks at a recognised object, which stops before it and looks at it.

After Arkin & Murphy, *Autonomous Navigation in a Manufacturing Environment*, 1990: at full speed from afar, slower
in the controlled zone, from a given side if one is asked for. The object's own echoes do not repel the robot, which
keeps its distance from it; the arbiter's clearance applies all the same. Memory: `number`, `x` and `y` are the chosen
object, `since_s` when it was last seen, `is_set` whether one is chosen, `index` 1 once the robot stands before it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Final

import numpy as np

from behaviors.response import Response
from behaviors.schema_call import Answer, Memory, Scene, Visited
from behaviors.turn import UNKNOWN_FRAME, is_aligned
from config.mission_step import ApproachObjectUse
from perception.percept import DetectedObject, wrap_angle

SCHEMA: Final = "approach_object"
SAME_M: Final = 0.4
"""An object without a number is the one seen before if it is nearer to it than this, m."""
FORGOTTEN_S: Final = 10.0
"""Time without the chosen object after which another one is chosen, s."""
ORBIT_RAD: Final = math.radians(40.0)
"""So far round the object the robot steers at a time on its way to the side where it is to stop."""
ECHO_MARGIN_M: Final = 0.25
"""Echoes within this of the object's outline are its own, m."""


def approach_object(scene: Scene, memory: Memory, use: ApproachObjectUse) -> Answer:
    """Return a vector to the place before the object, then the turn towards it, and whether both are done.

    Parameters
    ----------
    scene
        Pose, objects, and which have been visited.
    memory
        The object chosen.
    use
        Which object, on what side and from what distance.
    """
    still = Response(SCHEMA, 0.0, 0.0)
    memory = _chosen(scene, memory, use)
    if not memory.is_set:
        new = "new " if use.choose == "unvisited" else ""
        return Answer(still, memory, waits_for=f"no {new}{use.object} is recognised near the robot")
    frame = scene.frame(use.frame) if use.side_deg is not None else scene.frame("odom")
    if frame is None:
        return Answer(still, memory, waits_for=UNKNOWN_FRAME)
    pose, goal = scene.percept.pose, scene.behaviors.move_to_goal
    outline_m = (scene.radii_m or {}).get(use.object, 0.0)
    stop_m = outline_m + use.distance_m + scene.body.radius_m
    away_m, facing = (
        math.hypot(memory.x - pose.x, memory.y - pose.y),
        math.atan2(memory.y - pose.y, memory.x - pose.x),
    )
    side = facing + math.pi if use.side_deg is None else frame.theta + math.radians(use.side_deg)
    dx, dy = memory.x + stop_m * math.cos(side) - pose.x, memory.y + stop_m * math.sin(side) - pose.y
    remaining_m = math.hypot(dx, dy)
    visited = Visited(memory.number, memory.x, memory.y)
    if memory.index == 1 or remaining_m <= goal.success_radius_m:
        memory = replace(memory, index=1)
        has_arrived = is_aligned(scene.percept.pose, facing)
        return Answer(still, memory, has_arrived, 0.0, facing, visited=visited if has_arrived else None)
    round_rad = wrap_angle(side - (facing + math.pi))
    if abs(round_rad) > ORBIT_RAD and away_m > 0.0:
        # The straight way leads through the object or its echoes: round it, a piece at a time.
        at, orbit_m = facing + math.pi + math.copysign(ORBIT_RAD, round_rad), stop_m + goal.success_radius_m
        dx, dy = memory.x + orbit_m * math.cos(at) - pose.x, memory.y + orbit_m * math.sin(at) - pose.y
        remaining_m = math.hypot(dx, dy) + orbit_m * (abs(round_rad) - ORBIT_RAD)
    length = use.gain * min(1.0, remaining_m / goal.controlled_zone_m) / max(math.hypot(dx, dy), 1e-9)
    obstacles = scene.percept.obstacles
    own = np.hypot(obstacles[:, 0] - memory.x, obstacles[:, 1] - memory.y) < outline_m + ECHO_MARGIN_M
    return Answer(Response(SCHEMA, length * dx, length * dy), memory, remaining_m=remaining_m, own_echoes=own)


def matching(
    objects: Iterable[DetectedObject], name: str, probability_min: float, visited: tuple[Visited, ...] = ()
) -> list[DetectedObject]:
    """Return the objects of a name that are probable enough and not among those visited."""
    return [
        seen
        for seen in objects
        if seen.model == name and seen.score >= probability_min and not any(_is_same(seen, one) for one in visited)
    ]


def _chosen(scene: Scene, memory: Memory, use: ApproachObjectUse) -> Memory:
    """Return the memory with the chosen object where it is seen now, or with another if there is none."""
    pose, objects = scene.percept.pose, scene.percept.objects
    if memory.is_set:
        before = Visited(memory.number, memory.x, memory.y)
        same = [seen for seen in matching(objects, use.object, 0.0) if _is_same(seen, before)]
        if same:
            now = min(same, key=lambda seen: math.hypot(seen.x - memory.x, seen.y - memory.y))
            return replace(memory, number=now.number, x=now.x, y=now.y, since_s=scene.step_s)
        if memory.index == 1 or scene.step_s - memory.since_s < FORGOTTEN_S:
            return memory
    visited = scene.visited if use.choose == "unvisited" else ()
    found = matching(objects, use.object, use.probability_min, visited)
    if not found:
        return Memory()
    nearest = min(found, key=lambda seen: math.hypot(seen.x - pose.x, seen.y - pose.y))
    return Memory(0, nearest.x, nearest.y, nearest.number, scene.step_s, is_set=True)


def _is_same(seen: DetectedObject, before: Visited) -> bool:
    """Return whether an object is one seen before: by its number, or else where it stands."""
    if seen.number is not None and seen.number == before.number:
        return True
    return math.hypot(seen.x - before.x, seen.y - before.y) < SAME_M
