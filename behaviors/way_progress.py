"""Whether a drive makes progress towards what its request wants; a robot without any for `STALLED_S` says why.

Progress is coming nearer to where the request leads, or new ground where it leads nowhere in particular. A robot that
drives to and fro before a wall moves all the time and makes none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from perception.percept import Pose

STALLED_S: Final = 20.0
"""After so long without progress the operator reads why, s."""
ENDED_S: Final = 2.0 * STALLED_S
"""After so long a request that nothing else ends takes another way, or ends, s."""
NEARER_M: Final = 0.1
"""Coming nearer by less than this is no progress, m."""
GROUND_M: Final = 0.5
"""New ground is at least so far from where the robot last made progress, m: turning to and fro does not reach it."""


@dataclass(frozen=True, slots=True)
class WayProgress:
    """The newest progress of a drive; times by the run's clock."""

    part: int = 0
    """Which part of the request that was: a leg's direction or a mission's step."""
    best_m: float | None = None
    """Least distance left so far, m; None where the request leads nowhere in particular."""
    x: float = 0.0
    y: float = 0.0
    """Where the robot was, m in odometry's frame."""
    run_s: float | None = None
    """When it was; None before the first cycle."""

    def observe(
        self, pose: Pose, remaining_m: float | None, part: int, requested_run_s: float, run_s: float
    ) -> WayProgress:
        """Return the progress after a cycle.

        Parameters
        ----------
        pose
            The robot's, in odometry's frame.
        remaining_m
            Distance left to where the request leads, m, from any origin; None if it leads nowhere in particular.
        part
            Which part of the request is driven; another one starts anew.
        requested_run_s, run_s
            When the request was made, and now, by the run's clock, s.
        """
        is_new = self.run_s is None or part != self.part or requested_run_s > self.run_s
        if not is_new and remaining_m is not None and self.best_m is not None:
            is_new = remaining_m <= self.best_m - NEARER_M
        elif not is_new:
            is_new = remaining_m != self.best_m or math.hypot(pose.x - self.x, pose.y - self.y) >= GROUND_M
        return WayProgress(part, remaining_m, pose.x, pose.y, run_s) if is_new else self

    def stalled_s(self, run_s: float) -> float:
        """Return for how long there was no progress, s."""
        return 0.0 if self.run_s is None else run_s - self.run_s
