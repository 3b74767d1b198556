"""Whether a drive to a goal makes progress, or has to be given up.

Two faults end a drive. The robot is *stuck* if it has hardly moved for some time, as in nav2's simple progress
checker. The goal is *unreachable* if something stands on it, or if the robot moves and comes no nearer to it than
it has been, for a longer time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, Literal, NamedTuple, TypeAlias

from behaviors.memory.way_progress import NEARER_M
from config.behaviors import MoveToGoalConfig
from config.bounded import Coordinate, Seconds
from perception.percept import Pose

Fault: TypeAlias = Literal["stuck", "unreachable"]


class Beside(NamedTuple):
    """What stands nearest to a goal."""

    away_m: float
    """Its distance from the goal, m; infinite while nothing sure is known near it."""
    body_m: float
    """Radius of the body, m."""
    needed_m: float
    """Least distance from the goal at which the body passes it, m."""
    is_line: bool = False
    """Whether it is a no-go line, which nothing stands on."""

    @property
    def is_on_goal(self) -> bool:
        """Whether it stands where the body would stand."""
        return self.away_m < self.body_m

    @property
    def goal_fault(self) -> str:
        """What is wrong with the goal, for the end of a reason; empty if nothing is."""
        if self.away_m >= self.needed_m:
            return ""
        more_m = math.ceil(20.0 * (self.needed_m - self.away_m)) / 20.0
        what = "the no-go line there" if self.is_line else "what stands there"
        return (
            f": {what} is {self.away_m:.2f} m from the goal, and the robot needs {self.needed_m:.2f} m "
            f"(set the goal {more_m:.2f} m farther from it)"
        )


NOTHING_BESIDE: Final = Beside(math.inf, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Progress:
    """The progress of a drive to a goal; times by the run's clock."""

    x: Coordinate
    y: Coordinate
    moved_run_s: Seconds
    """Where the robot was when it had last moved, and when, m and s."""
    nearest_m: Coordinate
    nearer_run_s: Seconds
    """The smallest distance to the goal so far, and when it was reached, m and s."""
    excused_run_s: Seconds | None = None
    """Until when a detour led away from the goal, s; such a robot comes no nearer, and is not given up for it."""
    given_up: str | None = None
    """Why the drive has ended short of the goal; None while it goes on."""
    fault: Fault | None = None
    """Which of the two faults that was."""

    @classmethod
    def starting_at(cls, pose: Pose, distance_m: float, run_s: float) -> Progress:
        """Return the progress of a drive that starts now."""
        return cls(pose.x, pose.y, run_s, distance_m, run_s)


def observe_progress(
    before: Progress,
    pose: Pose,
    distance_m: float,
    run_s: float,
    held: str | None,
    config: MoveToGoalConfig,
    *,
    is_blocked: bool = False,
    beside: Beside = NOTHING_BESIDE,
) -> Progress:
    """Return the progress after a cycle; a drive that was given up stays so.

    Parameters
    ----------
    before : Progress
        In the cycle before.
    pose : Pose
        Where the robot is, in odometry's frame.
    distance_m : float
        To the goal, m.
    run_s : float
        Now, by the run's clock, s.
    held : str or None
        Why it stands, for the operator, if that is known.
    config : MoveToGoalConfig
        How long either fault may last.
    is_blocked : bool
        Whether the map shows no way on from here to the goal.
    beside : Beside
        What stands at the goal, which the robot is near; from afar it may be no more than the arc of an echo.
    """
    if before.given_up is not None:
        return before
    after = before
    if math.hypot(pose.x - before.x, pose.y - before.y) >= config.stuck_m:
        after = replace(after, x=pose.x, y=pose.y, moved_run_s=run_s)
    if distance_m <= before.nearest_m - NEARER_M:
        after = replace(after, nearest_m=distance_m, nearer_run_s=run_s)
    stood_s, stayed_s = run_s - after.moved_run_s, run_s - max(after.nearer_run_s, after.excused_run_s or 0.0)
    fault: Fault = "unreachable"
    if stood_s >= config.stuck_after_s and not beside.is_on_goal:
        if is_blocked:
            why = f"the goal is unreachable: the map shows no way to it, {distance_m:.1f} m short of it"
        else:
            cause = "" if held is None else f" ({held})"
            little = f"less than {config.stuck_m:g} m in {stood_s:.0f} s"
            fault = "stuck"
            why = f"stuck {distance_m:.1f} m short of the goal: {little}{cause}"
    elif beside.is_on_goal and stayed_s >= config.stuck_after_s:
        why = f"the goal is unreachable: something stands there, no nearer than {after.nearest_m:.1f} m"
    elif stayed_s >= config.unreachable_after_s:
        why = f"the goal is unreachable: no nearer than {after.nearest_m:.1f} m for {stayed_s:.0f} s"
    else:
        return after
    return replace(after, given_up=why + beside.goal_fault, fault=fault)
