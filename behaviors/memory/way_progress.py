"""Whether a drive makes progress towards what its request wants; a robot without any for `STALLED_S` says why.

Progress is coming nearer to where the request leads, or new ground where it leads nowhere in particular. A robot that
drives to and fro before a wall moves all the time and makes none. A goal and a mission keep their own progress
(`behaviors.memory.goal_progress`, `behaviors.missions.mission`), by the same distances; legs keep the one here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from config.bounded import Coordinate, Seconds

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
    """The newest progress along legs; times by the run's clock."""

    outbound: bool = True
    """In which direction that was."""
    best_m: Coordinate | None = None
    """Least distance left so far, m from any origin; None before the first cycle."""
    run_s: Seconds = 0.0
    """When it was."""

    def observe(self, remaining_m: float, requested_run_s: float, run_s: float, *, outbound: bool) -> WayProgress:
        """Return the progress after a cycle.

        Parameters
        ----------
        remaining_m
            Distance left in the direction of the leg, m, from any origin.
        requested_run_s, run_s
            When the legs were requested, and now, by the run's clock, s.
        outbound
            Whether the leg leads outbound; the other direction starts anew.
        """
        goes_on = self.best_m is not None and outbound is self.outbound and requested_run_s <= self.run_s
        if goes_on and self.best_m is not None and remaining_m > self.best_m - NEARER_M:
            return self
        return WayProgress(outbound, remaining_m, run_s)

    def stalled_s(self, run_s: float) -> float:
        """Return for how long there was no progress, s."""
        return 0.0 if self.best_m is None else run_s - self.run_s
