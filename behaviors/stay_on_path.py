"""The stay-on-path schema: a vector towards a point of the path a little ahead of the robot.

Steering for a point ahead on the path is pure pursuit (Coulter, CMU-RI-TR-92-01). How far the robot has come along
the path never decreases, and is looked for only a little ahead: so a path may cross itself, and an obstacle on it
only pushes the robot to one side. Memory: `x` is the way along the path, m.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final, TypeAlias

from behaviors.response import Response
from behaviors.schema_call import Answer, Memory, Scene
from behaviors.turn import UNKNOWN_FRAME
from config.mission_step import StayOnPathUse
from perception.percept import Pose

SCHEMA: Final = "stay_on_path"

Places: TypeAlias = Sequence[tuple[float, float]]


def stay_on_path(scene: Scene, memory: Memory, use: StayOnPathUse) -> Answer:
    """Return a vector along the path, shorter near its end, and whether its end is reached.

    Parameters
    ----------
    scene
        Pose and map frame. The last corner counts as reached, and slows the robot down, as a goal does.
    memory
        How far the robot has come.
    use
        The path, its frame, the gain and the distance to look ahead.
    """
    frame = scene.frame(use.frame)
    if frame is None:
        return Answer(Response(SCHEMA, 0.0, 0.0), memory, waits_for=UNKNOWN_FRAME)
    here = frame.inverse().compose(scene.percept.pose)
    # Of a path's piece that leads back, only what the robot can have driven since counts.
    way_m = nearest_way_m(use.points_m, (here.x, here.y), memory.x, memory.x + 2.0 * use.lookahead_m)
    memory = replace(memory, x=way_m)
    length_m = sum(math.dist(a, b) for a, b in pairwise(use.points_m))
    goal, to_goal = scene.behaviors.move_to_goal, math.dist((here.x, here.y), use.points_m[-1])
    remaining_m = max(length_m - way_m, to_goal)
    if length_m - way_m <= use.lookahead_m and to_goal <= goal.success_radius_m:
        return Answer(Response(SCHEMA, 0.0, 0.0), memory, has_arrived=True, remaining_m=remaining_m)
    ahead = place_at(use.points_m, way_m + use.lookahead_m)
    there = frame.compose(Pose(*ahead, 0.0))
    dx, dy = there.x - scene.percept.pose.x, there.y - scene.percept.pose.y
    length = use.gain * min(1.0, remaining_m / goal.controlled_zone_m) / max(math.hypot(dx, dy), 1e-9)
    return Answer(Response(SCHEMA, length * dx, length * dy), memory, remaining_m=remaining_m)


def nearest_way_m(points_m: Places, place: tuple[float, float], from_m: float, to_m: float) -> float:
    """Return the way along a path to its point nearest to a place, of those between two ways, m."""
    best, best_m, begin = from_m, math.inf, 0.0
    for a, b in pairwise(points_m):
        side = math.dist(a, b)
        low, high = max(from_m, begin), min(to_m, begin + side)
        if low <= high:
            ux, uy = (b[0] - a[0]) / side, (b[1] - a[1]) / side
            along = begin + (place[0] - a[0]) * ux + (place[1] - a[1]) * uy
            along = min(high, max(low, along))
            away = math.dist(place, (a[0] + (along - begin) * ux, a[1] + (along - begin) * uy))
            if away < best_m:
                best, best_m = along, away
        begin += side
    return best


def place_at(points_m: Places, way_m: float) -> tuple[float, float]:
    """Return the place of a path after some way along it; its end beyond that, m."""
    for a, b in pairwise(points_m):
        side = math.dist(a, b)
        if way_m <= side:
            return a[0] + way_m / side * (b[0] - a[0]), a[1] + way_m / side * (b[1] - a[1])
        way_m -= side
    return points_m[-1]
