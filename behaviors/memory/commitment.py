"""What the arbiter keeps from cycle to cycle, so that neither speed nor turning changes its sign too often.

Echoes, gaps between beams and schemas that cancel one another may allow a speed in one cycle and none in the next, or
point the course ahead and behind, or left and right, in turn. A base that follows each of them is worn out and comes
nowhere. So a start waits until `START_S` after the start before it. A turn to the other side waits until `TURN_S`
after the one before. And a robot that turns on the spot to a course that is nearly opposite keeps its side.

Stopping and driving slower never wait, and neither does a direction that an operator newly asks for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from config.bounded import Seconds, Sign, Speed
from perception.percept import Twist

START_S: Final = 2.0
"""Least time between two starts, s: each is followed by one stop, which makes one change a second."""
TURN_S: Final = 1.0
"""Least time between two changes of the side to which the robot turns, s."""
FAINT_RAD_S: Final = 0.05
"""A slower turn is to neither side: real wheels may stick (`motion_monitor.CRAWL`)."""
OPPOSITE_RAD: Final = math.radians(150.0)
"""A course farther off the heading than this is nearly opposite: either side is about as far."""


@dataclass(frozen=True, slots=True)
class Commitment:
    """What the last command committed the robot to; immutable, as keyframes hold it."""

    started_run_s: Seconds | None = None
    """When the robot last started, by the run's clock; None before the first start under this request."""
    turn_rad_s: Speed = 0.0
    """Turning rate of the last command, rad/s."""
    requested: Sign = 0
    """Sign of the speed that an operator asks for; 0 without one."""
    is_moving: bool = False
    """Whether the last command had a speed."""
    side: Sign = 0
    """Sign of the last turn that was not faint; 0 before the first one under this request."""
    turned_run_s: Seconds | None = None
    """When that sign last changed, by the run's clock."""

    def kept_angle(self, angle_rad: float, run_s: float | None = None) -> float:
        """Return the angle by which to turn to a course, within (−2π, 2π): on the side to which the robot turns.

        Parameters
        ----------
        angle_rad
            The course's angle from the heading, within [−π, π], rad.
        run_s
            Now, by the run's clock, s; None if a turn to the other side need not wait.
        """
        turned_s = math.inf if run_s is None or self.turned_run_s is None else run_s - self.turned_run_s
        if angle_rad * self.side < 0.0 <= turned_s < TURN_S:  # it drives straight on, or turns the long way
            return 0.0 if self.is_moving else angle_rad + math.copysign(2.0 * math.pi, self.side)
        if self.is_moving or abs(angle_rad) <= OPPOSITE_RAD or angle_rad * self.turn_rad_s >= 0.0:
            return angle_rad
        return angle_rad + math.copysign(2.0 * math.pi, self.turn_rad_s)

    def commit(self, twist: Twist, run_s: float, requested: int = 0) -> tuple[Twist, Commitment]:
        """Return the velocity to command, without its speed if that is a start that waits; and what it commits to.

        Parameters
        ----------
        twist
            The velocity that was decided on.
        run_s
            Now, by the run's clock, s.
        requested
            Sign of the speed that an operator asks for; another one than before does not wait.
        """
        started_run_s = self.started_run_s if requested == self.requested else None
        side, turned_run_s = (twist.w > FAINT_RAD_S) - (twist.w < -FAINT_RAD_S), self.turned_run_s
        if side in {0, self.side}:
            side = self.side
        else:
            turned_run_s = run_s
        is_start = twist.v != 0.0 and (not self.is_moving or started_run_s is None)
        if is_start and started_run_s is not None and 0.0 <= run_s - started_run_s < START_S:
            twist, is_start = Twist(0.0, twist.w), False
        started_run_s = run_s if is_start else started_run_s
        return twist, Commitment(started_run_s, twist.w, requested, twist.v != 0.0, side, turned_run_s)
