"""The leave-canyon schema: no dead end is entered for a goal that lies behind it, and none holds the robot.

A vector towards a goal leads into every box canyon in front of it, and holds the robot at the back. This schema takes
over from move-to-goal while something closes the way: it goes round along it with a side that it keeps (Lumelsky &
Stepanov, Algorithmica 2, 1987, proved that this arrives), until the robot is nearer to the goal than ever before and
the goal's direction is free. What closes the way is

- echoes ahead;
- the mouth of a known canyon (`perception.percept.Canyon`): a virtual wall for a goal that does not lie behind it;
- what may be a canyon's back, far ahead (`behaviors.surroundings.blocked_ahead`).

A robot inside a known canyon leaves it, however free its goal's direction is there. One so narrow that both sides
are within the room that is kept is left by its middle line: what is heard at the ends of its walls is placed on the
axes of the sensors, so that the exit may seem too narrow for a robot that has come in through it.

Progress is state, and behaviours hold none: the detour (`behaviors.memory.detour`) is passed in and returned with
each call.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from behaviors.memory.detour import Detour, Side
from behaviors.memory.near_memory import places, remember
from behaviors.response import Response
from behaviors.steady_heading import turned_towards
from behaviors.surroundings.blocked_ahead import (
    between,
    blocked_ahead,
    outline,
    pocket_ahead,
    presume,
    widen,
)
from behaviors.surroundings.clearance import free_paths_m
from config.behaviors import LeaveCanyonConfig
from config.robot import PASSAGE_M
from perception.percept import Canyon, Floats, Percept, Pose, wrap_angle

SCHEMA: Final = "leave_canyon"

OPEN_SIDE_M: Final = 2.0
"""Nothing is presumed where neither side is free for this far beyond the robot's way: that is a corridor."""
SAME_WALL_RAD: Final = math.radians(100.0)
NEXT_WALL_RAD: Final = math.radians(135.0)
"""A heading farther than this from the obstacle's direction leads along the next one, in a corner or at a back."""
LOST_M: Final = 1.0
"""The obstacle is what is nearest within this angle of where it lay, and within this distance of the way."""
NO_POINTS: Final = np.empty((0, 2))
TURN_SHARE: Final = 0.15
"""The direction turns by this share of the angle to the chosen one in each cycle."""
OUTWARDS_M: Final = 0.5
"""A robot that leaves a canyon aims at a point of its middle line so far ahead, m."""
THROUGH_M: Final = 1.5
"""A gap is passed if the robot sees so far through it, m."""
TURNS: Final = np.arange(0.0, 2.0 * math.pi, math.radians(5.0))
"""Turns from the obstacle's direction that are tried, in this order."""


class Place(NamedTuple):
    """Where a robot is to stand, in odometry's frame."""

    x: float
    y: float
    room_m: float
    """Least distance from it to what stands beside it, m."""


def leave_canyon(
    percept: Percept,
    goal: tuple[float, float],
    detour: Detour,
    body_radius_m: float,
    config: LeaveCanyonConfig,
    *,
    waits: bool = False,
    last_rad: float | None = None,
) -> tuple[Response | None, Detour]:
    """Return the vector round what closes the way to a goal, None while nothing does; and the detour so far.

    Parameters
    ----------
    percept
        Pose, obstacles and canyons.
    goal
        Its place in odometry's frame, m.
    detour
        As the last call returned it; `NO_DETOUR` for a new goal.
    body_radius_m
        Of the robot, m.
    config
        The schema's settings.
    waits
        Another schema finds a way between single obstacles: echoes ahead alone begin a detour only where the robot
        drives and comes no nearer.
    last_rad
        The direction of the cycle before, from which the robot turns steadily; None: it turns at once.
    """
    pose, room = percept.pose, body_radius_m + config.room_m
    dx, dy = goal[0] - pose.x, goal[1] - pose.y
    to_goal, bearing = math.hypot(dx, dy), math.atan2(dy, dx)
    echoes = percept.obstacles if percept.steady is None else percept.steady
    # With an evidence grid the look-ahead goes round what was heard; in a building a wall answers ahead on most ways.
    reach_m = config.look_ahead_m if percept.occupancy is None else 0.0
    detour = _presume(echoes, pose, detour, to_goal, bearing, room, reach_m, room + 0.5 * config.look_m)
    stand = Place(*goal, body_radius_m + PASSAGE_M)
    virtual = _virtual(percept, stand, detour, config)
    near = remember(detour.near, echoes, pose, detour.driven_m, body_radius_m)
    is_free = _free_m(np.concatenate([echoes, places(near)]), pose, bearing, stand.room_m) >= to_goal
    held = _held(percept, stand, config, is_free=is_free)
    leaving = _leaving(held, detour.leaving, pose, stand, room, is_free=is_free)
    detour = replace(detour.nearer(to_goal), near=near, leaving=leaving)
    is_held = leaving is not None or len(held) > 0
    waits = waits and detour.side == 0 and not detour.is_held
    if waits and not virtual and not is_held:  # only echoes could close the way
        return None, detour
    points = np.concatenate([echoes, places(detour.near), *virtual])
    counted = np.concatenate([NO_POINTS, *virtual]) if waits else points
    free = _free_m(counted, pose, bearing, body_radius_m + PASSAGE_M)
    if detour.side == 0:
        if free >= min(to_goal, config.look_m) and not is_held:
            return None, detour
        detour = _begin(points, percept, stand, held, detour, room, config)
    elif not is_held and detour.ends_at(to_goal, free):
        return None, detour.ended()
    else:
        detour = detour.on_a_side_that_leads_on(pose, goal, has_grid=percept.occupancy is not None)
    wall, heading = _along(points, pose, detour.side, detour.wall_rad, room, config)
    if leaving is not None:
        heading = _outwards(leaving, pose)
    if (kept := detour.given_up(to_goal, heading)) is not None:
        return None, kept
    if last_rad is not None:
        heading = _steadied(points, pose, last_rad, heading, body_radius_m + PASSAGE_M, config.look_m)
    gain, detour = config.leave_canyon_gain, replace(detour, wall_rad=wall)
    return Response(SCHEMA, gain * math.cos(heading), gain * math.sin(heading)), detour


def _virtual(percept: Percept, goal: Place, detour: Detour, config: LeaveCanyonConfig) -> list[Floats]:
    """Return points on walls that are only thought of, each (n, 2): mouths that are closed, and what is presumed."""
    closed = [canyon for canyon in percept.canyons if is_closed(canyon, percept.pose, goal, config)]
    walls = [between(*canyon.mouth) for canyon in closed]
    return walls if detour.block is None else [*walls, outline(detour.block)]


def _steadied(points: Floats, pose: Pose, last_rad: float, heading_rad: float, room_m: float, look_m: float) -> float:
    """Return the direction of the last cycle turned a little towards the wanted one if that way is free, rad."""
    turned = turned_towards(last_rad, heading_rad, TURN_SHARE)
    return turned if _free_m(points, pose, turned, room_m) >= look_m else heading_rad


def _free_m(points: Floats, pose: Pose, heading_rad: float, room_m: float) -> float:
    return float(free_paths_m(points, pose, np.array([heading_rad]), room_m)[0])


def is_closed(canyon: Canyon, pose: Pose, goal: Place, config: LeaveCanyonConfig) -> bool:
    """Return whether a canyon's mouth is a wall for this robot: neither it nor the goal is inside."""
    if canyon.probability < config.probability_min:
        return False
    return not (_is_inside(canyon, pose.x, pose.y) or _has_goal(canyon, goal))


def holds(canyon: Canyon, pose: Pose, goal: Place, config: LeaveCanyonConfig, *, is_free: bool) -> bool:
    """Return whether the robot is inside a canyon that it must leave for its goal; `is_free`: as far as is heard."""
    is_inside = canyon.probability >= config.probability_min and _is_inside(canyon, pose.x, pose.y)
    return is_inside and not _has_goal(canyon, goal) and not (is_free and _is_beside(canyon, goal))


def _half_width_m(canyon: Canyon) -> float:
    x1, y1, x2, y2 = canyon.mouth
    return 0.5 * abs(math.cos(canyon.axis_rad) * (y2 - y1) - math.sin(canyon.axis_rad) * (x2 - x1))


def _is_inside(
    canyon: Canyon, x: float, y: float, before_m: float = 0.0, behind_m: float = 0.0, beside_m: float = 0.0
) -> bool:
    """Return whether a place is inside a canyon, or as little before its mouth, behind its back, or beside it, m."""
    x1, y1, x2, y2 = canyon.mouth
    c, s = math.cos(canyon.axis_rad), math.sin(canyon.axis_rad)
    dx, dy = x - 0.5 * (x1 + x2), y - 0.5 * (y1 + y2)
    depth_m, half_m = canyon.depth_m + behind_m, _half_width_m(canyon) + beside_m
    return -before_m < c * dx + s * dy < depth_m and abs(c * dy - s * dx) < half_m


def _held(percept: Percept, goal: Place, config: LeaveCanyonConfig, *, is_free: bool) -> list[Canyon]:
    return [canyon for canyon in percept.canyons if holds(canyon, percept.pose, goal, config, is_free=is_free)]


def _has_goal(canyon: Canyon, goal: Place) -> bool:
    """Return whether a goal is inside a canyon, whose walls are known as a rectangle: they bend and slant.

    What is so near beyond a side that the body could not stand there is inside.
    """
    return _is_inside(canyon, goal.x, goal.y, behind_m=goal.room_m, beside_m=goal.room_m)


def _is_beside(canyon: Canyon, goal: Place) -> bool:
    """Return whether a goal lies beside a canyon, and neither behind its back nor before its mouth.

    Behind its mouth a canyon may be wider than there: such a goal is outside only if something is heard between.
    """
    return _is_inside(canyon, goal.x, goal.y, beside_m=math.inf)


def _leaving(
    held: list[Canyon], before: Canyon | None, pose: Pose, goal: Place, room_m: float, *, is_free: bool
) -> Canyon | None:
    """Return the narrow canyon that the robot leaves by its middle line, until its body is outside; None without one.

    Of several that hold it the deepest: the ends of walls are found from the inside outwards. One that it was leaving
    need not be left where the goal beside it is seen to be free.
    """
    narrow = [canyon for canyon in held if _half_width_m(canyon) < room_m]
    if before is not None and _is_inside(before, pose.x, pose.y, room_m):
        is_excused = is_free and _is_inside(before, pose.x, pose.y) and _is_beside(before, goal)
        narrow += [] if is_excused else [before]
    return max(narrow, key=lambda canyon: canyon.depth_m) if narrow else None


def _outwards(canyon: Canyon, pose: Pose) -> float:
    """Return the heading to the middle line of a canyon a little further out, rad."""
    x1, y1, x2, y2 = canyon.mouth
    c, s = math.cos(canyon.axis_rad), math.sin(canyon.axis_rad)
    across = c * (pose.y - 0.5 * (y1 + y2)) - s * (pose.x - 0.5 * (x1 + x2))
    return wrap_angle(canyon.axis_rad + math.pi + math.atan2(across, OUTWARDS_M))


def _presume(
    echoes: Floats,
    pose: Pose,
    detour: Detour,
    to_goal_m: float,
    bearing_rad: float,
    room_m: float,
    reach_m: float,
    front_m: float,
) -> Detour:
    """Return the detour with the way driven and what is presumed far ahead brought up to date."""
    step = 0.0 if detour.x is None or detour.y is None else math.hypot(pose.x - detour.x, pose.y - detour.y)
    detour = replace(detour, x=pose.x, y=pose.y, driven_m=detour.driven_m + step)
    reach = min(reach_m, to_goal_m)
    if detour.block is not None:
        pocket = pocket_ahead(echoes, pose, detour.block.axis_rad, reach)
        return replace(detour, block=widen(detour.block, echoes, pose, pocket))
    if detour.side != 0 or (reach <= 0.0 and detour.ahead is None):
        return detour
    pocket = pocket_ahead(echoes, pose, bearing_rad, reach)
    ahead = blocked_ahead(echoes, pose, bearing_rad, reach, detour.ahead, step, room_m, pocket)
    detour = replace(detour, ahead=ahead)
    if detour.ahead is None or not detour.ahead.is_sure or to_goal_m > detour.presume_below_m:
        return detour
    if not _open_sides(echoes, pose, bearing_rad, room_m):
        return detour
    return replace(detour, block=presume(detour.ahead, pose, bearing_rad, front_m, pocket))


def _open_sides(points: Floats, pose: Pose, way_rad: float, room_m: float) -> list[Side]:
    """Return the sides on which a robot on this way keeps an obstacle if it gives way to where there is room."""
    sides: tuple[Side, Side] = (1, -1)
    across = np.array([way_rad - 0.5 * math.pi * side for side in sides])
    free = free_paths_m(points, pose, across, room_m)
    return [side for side, path in zip(sides, free.tolist(), strict=True) if path >= OPEN_SIDE_M]


def _begin(
    points: Floats,
    percept: Percept,
    goal: Place,
    held: list[Canyon],
    detour: Detour,
    room_m: float,
    config: LeaveCanyonConfig,
) -> Detour:
    """Return a detour that begins here, on the side that promises the shorter way; `held` canyons are to be left."""
    pose = percept.pose
    to_goal, bearing = math.hypot(goal.x - pose.x, goal.y - pose.y), math.atan2(goal.y - pose.y, goal.x - pose.x)

    def cost(side: Side) -> float:
        for canyon in percept.canyons:
            if canyon in held or is_closed(canyon, pose, goal, config):
                end = _end(canyon, side)
                return math.dist((pose.x, pose.y), end) + math.dist(end, goal[:2])
        _, heading = _along(points, pose, side, bearing, room_m, config)
        return abs(wrap_angle(heading - bearing))

    sides: list[Side] = [1, -1]
    if detour.block is not None:
        sides = _open_sides(points, pose, bearing, room_m) or sides
    side = min(sides, key=cost)
    began_m = min(to_goal, detour.nearest_m)
    return replace(
        detour,
        side=side,
        began_m=began_m,
        began_x=pose.x,
        began_y=pose.y,
        began_driven_m=detour.driven_m,
        wall_rad=bearing,
    )


def _end(canyon: Canyon, side: Side) -> tuple[float, float]:
    """Return the end of a mouth round which a robot goes that keeps the canyon on this side."""
    x1, y1, x2, y2 = canyon.mouth
    is_left = math.cos(canyon.axis_rad) * (y1 - y2) - math.sin(canyon.axis_rad) * (x1 - x2) > 0.0
    return (x1, y1) if is_left == (side == -1) else (x2, y2)


def _along(
    points: Floats, pose: Pose, side: int, wall_rad: float, room_m: float, config: LeaveCanyonConfig
) -> tuple[float, float]:
    """Return the direction of the obstacle that is gone round, and the heading along it, rad.

    The heading is the first free one from the obstacle's direction away from it: so the robot approaches what is too
    far, leaves what is too near, turns in a corner before it is in it, and passes no gap that is too narrow.
    """
    dx, dy = points[:, 0] - pose.x, points[:, 1] - pose.y
    bearings, distances = np.arctan2(dy, dx), np.hypot(dx, dy)
    off = np.abs(np.remainder(bearings - wall_rad + math.pi, 2.0 * math.pi) - math.pi)
    distances = np.where(off < SAME_WALL_RAD, distances, math.inf)
    if len(points) and distances.min() < room_m + LOST_M:
        wall_rad = float(bearings[distances.argmin()])
    headings = wall_rad - side * TURNS
    free = free_paths_m(points, pose, headings, room_m)
    is_free = free >= config.look_m
    chosen = int(is_free.argmax()) if is_free.any() else int(free.argmax())
    through = free_paths_m(points, pose, headings, room_m - config.room_m + PASSAGE_M) >= THROUGH_M
    chosen = _gap(through, chosen if is_free.any() else len(TURNS), chosen)
    heading = float(headings[chosen])
    if TURNS[chosen] > NEXT_WALL_RAD:
        wall_rad = heading + 0.5 * math.pi * side
    return wrap_angle(wall_rad), wrap_angle(heading)


def _gap(through: NDArray[np.bool_], end: int, otherwise: int) -> int:
    """Return the middle of the first gap before `end`: a run of directions with nothing free on either side."""
    edges = np.diff(through[:end].astype(np.int8)).nonzero()[0] + 1
    edges = edges[1:] if len(edges) and not through[edges[0]] else edges
    return int(edges[0] + edges[1] - 1) // 2 if len(edges) > 1 else otherwise
