"""The follow-valley schema: towards the goal through the free valley that VFH+ chooses, its target from a look-ahead.

Each cycle VFH+ answers at once (`behaviors.valley`). What time is left improves its target (`look_ahead`). Behaviours
hold no state, so the valley is passed in and returned with each call.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Final

from pydantic import Field

from behaviors.response import Response
from behaviors.steady_heading import held, turned_towards
from behaviors.valley.choice import apart, candidates, cheapest, gaps
from behaviors.valley.look_ahead import Search, carrot
from behaviors.valley.polar_histogram import (
    SECTOR_RAD,
    SECTORS,
    blocked_sectors,
    cells_near,
    masked_by_turning,
    room_m,
)
from config.behaviors import FollowValleyConfig
from config.bounded import Coordinate
from config.robot import PASSAGE_M
from perception.percept import Percept

SCHEMA: Final = "follow_valley"
LEAST_WAY_M: Final = 0.1
"""A direction is blocked if the robot cannot drive so far in it, however near the target is, m."""
AT_GOAL_M: Final = 1.5
"""From so near the ring hears what stands at the goal, m; the grid still shows the arcs of echoes from afar there."""
STRAIGHT: Final = 0.5
"""A target within so many sectors of the goal's direction is the goal: the way is straight."""


@dataclass(frozen=True, slots=True)
class Valley:
    """What the schema keeps from one cycle to the next."""

    blocked: Annotated[str, Field(pattern=f"^[01]{{{SECTORS}}}$")] = "0" * SECTORS
    """The sectors of the odometry's frame, from its x axis counter-clockwise: 1 where something stands in the way."""
    direction_rad: Coordinate | None = None
    """The direction that was chosen; None if none is free, or before the first choice."""


def follow_valley(
    percept: Percept,
    to_goal: Response,
    goal_m: float,
    before: Valley,
    search: Search,
    body_radius_m: float,
    config: FollowValleyConfig,
) -> tuple[Response, Valley]:
    """Return the schema's vector, of length zero if no direction is free, and the valley for the next call.

    Parameters
    ----------
    percept : Percept
        Pose, evidence grid and fresh echoes.
    to_goal : Response
        The vector of move-to-goal: its length is kept, its direction replaced.
    goal_m : float
        Distance of the goal, m.
    before : Valley
        From the call before; ``Valley()`` at first.
    search : Search
        The look-ahead, whose way the target is on; without one it is the goal.
    body_radius_m : float
        Radius of the robot, m.
    config : FollowValleyConfig
        The schema's settings.
    """
    norm = math.hypot(to_goal.x, to_goal.y)
    length = config.follow_valley_gain * norm
    pose = percept.pose
    if not (math.isfinite(length) and math.isfinite(pose.theta)) or length == 0.0:
        return Response(SCHEMA, to_goal.x, to_goal.y), before
    target_rad, target_m = math.atan2(to_goal.y, to_goal.x), goal_m
    # Of a goal beside a wall one look-ahead finds that it can be reached, and the next that it cannot.
    is_there = goal_m < config.look_ahead_step_m
    goal_x, goal_y, aim_m = goal_m * to_goal.x / norm, goal_m * to_goal.y / norm, 0.0
    if not is_there and (ahead := carrot(search, pose.x, pose.y, config.carrot_m)) is not None:
        dx, dy = ahead[0] - pose.x, ahead[1] - pose.y
        bearing = math.atan2(dy, dx)
        if apart(bearing / SECTOR_RAD, target_rad / SECTOR_RAD) > STRAIGHT:
            target_rad, target_m = bearing, math.hypot(dx, dy)
            aim_m = math.hypot(dx - goal_x, dy - goal_y)
    room_max_m, comfort_m = body_radius_m + config.safety_m, body_radius_m + config.comfort_m
    reach_m = config.free_m + max(room_max_m, comfort_m)
    heard_m = room_max_m if goal_m < AT_GOAL_M and aim_m < room_max_m else 0.0
    cells = cells_near(percept, pose.x, pose.y, reach_m, config, only_heard=(goal_x, goal_y, heard_m))
    radius_m = room_m(cells, body_radius_m, room_max_m)
    flags = before.blocked.encode("ascii").translate(_FLAGS)
    # A gap that the robot drives through is not given up for an echo at a post that comes and goes.
    is_in_gap = before.direction_rad is not None and flags[round(before.direction_rad / SECTOR_RAD) % SECTORS] == 1
    least_m = min(radius_m, body_radius_m + (0.0 if is_in_gap else PASSAGE_M))
    blocked, near, closed = blocked_sectors(
        cells, flags, (radius_m, max(radius_m, comfort_m), least_m), max(target_m, LEAST_WAY_M), config
    )
    kept = blocked
    if config.turning_radius_m > 0.0:
        masked = masked_by_turning(cells, pose.theta, radius_m, config.turning_radius_m)
        kept, closed = blocked | masked, closed | masked
    target = target_rad / SECTOR_RAD
    last = None if before.direction_rad is None else before.direction_rad / SECTOR_RAD
    wide = math.radians(config.wide_valley_deg) / SECTOR_RAD
    found = candidates(kept.tobytes(), target, wide) + gaps(closed.tobytes(), kept.tobytes())
    # A gap is offered only where nothing wider leads the same way, and costs no more for being one.
    chosen = cheapest(found, target, pose.theta / SECTOR_RAD, last, (near & ~kept).tobytes(), config)
    shown = blocked.tobytes().translate(_DIGITS).decode("ascii")
    if chosen is None:
        return Response(SCHEMA, 0.0, 0.0), Valley(shown, None)
    direction = chosen * SECTOR_RAD
    if before.direction_rad is not None:
        turned = turned_towards(before.direction_rad, direction, config.turn_share)
        if not (closed if blocked[round(chosen) % SECTORS] else blocked)[round(turned / SECTOR_RAD) % SECTORS]:
            direction = turned
    driven = held(pose.theta, direction)
    return Response(SCHEMA, length * math.cos(driven), length * math.sin(driven)), Valley(shown, direction)


_DIGITS: Final = bytes.maketrans(b"\0\1", b"01")
_FLAGS: Final = bytes.maketrans(b"01", b"\0\1")
