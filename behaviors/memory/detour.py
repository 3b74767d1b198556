"""How far a robot has gone round what closes the way to its goal: the memory of the schema leave-canyon.

Ways are measured in metres, never in cycles, so that a robot that stands gives up nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

from behaviors.memory.near_memory import NearEchoes
from behaviors.surroundings.blocked_ahead import Ahead, Block
from config.bounded import Coordinate, Count
from perception.percept import Canyon, Pose, wrap_angle

Side: TypeAlias = Literal[-1, 1]

LEAVE_FREE_M: Final = 1.2
"""The detour ends where the goal's direction is free for this far, and the goal is nearer by `PROGRESS_M`."""
PROGRESS_M: Final = 0.4
"""The goal must be nearer by this than it has been before: so no detour ends where an earlier one began; by half of
what was left where that is less: one that began beside the goal would pass it."""
TURNED_BACK_RAD: Final = math.radians(150.0)
"""What was only presumed is given up if going round it leads back more than this."""
FARTHER_M: Final = 1.5
"""It is given up, too, so much farther from the goal than where the detour began: then other walls are followed, in
turn."""
PRESUMED_SHARE: Final = 0.7
"""Nothing more is presumed until the robot has come nearer by this share of the distance at which it was."""
NEARER_M: Final = 0.1
STALL_M: Final = 2.0
"""A robot that comes no nearer than this in so much driving is held."""
LED_AWAY_M: Final = 3.0
"""With an evidence grid a detour that leads so much farther from the goal than where it began tries its other side,
m: the grid's way may have been on the other one."""
LOOP_M: Final = 4.0
SAME_PLACE_M: Final = 0.4
"""A robot that is back where the detour began after this way has gone all round, and tries the other side."""
FAR_M: Final = 1e6
"""Farther than any goal."""


@dataclass(frozen=True, slots=True)
class Detour:
    """The progress of the schema (m, rad, odometry's frame)."""

    side: Literal[-1, 0, 1] = 0
    """Of the obstacle that is gone round: +1 it stays on the left, −1 on the right; 0 without a detour."""
    began_m: Coordinate = 0.0
    """Least distance to the goal until the detour began."""
    began_x: Coordinate = 0.0
    began_y: Coordinate = 0.0
    """The place where it began."""
    began_driven_m: Coordinate = 0.0
    """How far the robot had driven when it began."""
    driven_m: Coordinate = 0.0
    """The way since the goal was set."""
    rounds: Count = 0
    """How often the robot has gone all round."""
    nearest_m: Coordinate = FAR_M
    nearest_driven_m: Coordinate = 0.0
    """The least distance to the goal so far, and how far the robot had driven by then."""
    near: NearEchoes = ()
    """What was heard near the robot on its way."""
    wall_rad: Coordinate = 0.0
    """Where the obstacle lay in the last cycle."""
    x: Coordinate | None = None
    y: Coordinate | None = None
    """The robot's place in the last cycle."""
    leaving: Canyon | None = None
    """The narrow canyon that the robot is in and must leave."""
    ahead: Ahead | None = None
    """What stays far ahead."""
    block: Block | None = None
    """What that is presumed to be a part of."""
    presume_below_m: Coordinate = FAR_M
    """Distance to the goal below which something may be presumed."""

    @property
    def is_held(self) -> bool:
        """Whether the robot has driven far and come no nearer to its goal."""
        return self.driven_m - self.nearest_driven_m >= STALL_M

    def nearer(self, to_goal_m: float) -> Detour:
        """Return the detour with the least distance to the goal so far."""
        if to_goal_m >= self.nearest_m - NEARER_M:
            return self
        return replace(self, nearest_m=to_goal_m, nearest_driven_m=self.driven_m)

    def ends_at(self, to_goal_m: float, free_m: float) -> bool:
        """Return whether it ends where the goal's direction is free for so far: past all that is only presumed."""
        needed_m = to_goal_m if self.block is not None else min(to_goal_m, LEAVE_FREE_M)
        return to_goal_m < max(self.began_m - PROGRESS_M, 0.5 * self.began_m) and free_m >= needed_m

    def ended(self) -> Detour:
        """Return what is kept after it."""
        return replace(self, side=0, ahead=None, block=None)

    def on_a_side_that_leads_on(self, pose: Pose, goal: tuple[float, float], *, has_grid: bool) -> Detour:
        """Return it at its other side if this one has led far away from the goal, or all round."""
        other: Side = -1 if self.side == 1 else 1
        began, here = (self.began_x, self.began_y), (pose.x, pose.y)
        if has_grid and math.dist(here, goal) > math.dist(began, goal) + LED_AWAY_M:
            return replace(self, side=other, began_x=pose.x, began_y=pose.y, began_driven_m=self.driven_m)
        if self.driven_m - self.began_driven_m > LOOP_M and math.dist(here, began) < SAME_PLACE_M:
            bearing = math.atan2(goal[1] - pose.y, goal[0] - pose.x)
            return replace(self, side=other, began_driven_m=self.driven_m, wall_rad=bearing, rounds=self.rounds + 1)
        return self

    def given_up(self, to_goal_m: float, heading_rad: float) -> Detour | None:
        """Return what is kept where going round what was only presumed leads back, None where it leads on."""
        if self.block is None:
            return None
        back_rad = abs(wrap_angle(heading_rad - self.block.axis_rad))
        if back_rad <= TURNED_BACK_RAD and to_goal_m <= self.began_m + FARTHER_M:
            return None
        below = min(to_goal_m, self.began_m) - PRESUMED_SHARE * (self.block.back_m - self.block.front_m)
        return replace(self.ended(), presume_below_m=below)


NO_DETOUR: Final = Detour()
