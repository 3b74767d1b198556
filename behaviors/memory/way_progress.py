"""Whether a drive makes progress towards what its request wants; a robot without any for `STALLED_S` says why.

Progress is coming nearer to where the request leads, or new ground where it leads nowhere in particular. A robot that
drives to and fro before a wall moves all the time and makes none, and so does one that creeps: what counts is the way
gained in the whole of `STALLED_S`. What ends a goal and a mission's step are their own clocks
(`behaviors.memory.goal_progress`, `behaviors.missions.mission`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from config.bounded import Coordinate, Number, Seconds

STALLED_S: Final = 20.0
"""After so long without progress the operator reads why, s."""
ENDED_S: Final = 2.0 * STALLED_S
"""After so long a request that nothing else ends takes another way, or ends, s."""
NEARER_M: Final = 0.1
"""Coming nearer by less than this is no progress of a goal or a step, m."""
GROUND_M: Final = 0.5
"""New ground is at least so far from where the robot last made progress, m: turning to and fro does not reach it."""
STEPS: Final = 5
"""In so many steps that way is gained."""
STEP_TOLERANCE: Final = 1e-6
"""A step may be short by this share of it, as sums of floats are."""
SLOW: Final = 0.25
"""A base that cannot gain `GROUND_M` so in `STALLED_S` has to gain this share of what it can."""


def due_m(speed_m_s: float) -> float:
    """Return the way that a robot has to gain in `STALLED_S`, m.

    Parameters
    ----------
    speed_m_s
        What it drives on a free way, m/s.
    """
    return min(GROUND_M, SLOW * speed_m_s * STALLED_S)


@dataclass(frozen=True, slots=True)
class WayProgress:
    """The newest progress towards what is requested; times by the run's clock."""

    outbound: bool = True
    """In which direction of the legs that was."""
    best_m: Coordinate | None = None
    """Least distance left then, m from any origin; None before the first cycle."""
    run_s: Seconds = 0.0
    """When it was."""
    part: Number = 0
    """In which part of a mission it was."""
    steps_run_s: tuple[Seconds, ...] = ()
    """When the last `STEPS` steps of progress were made, the oldest first."""

    def observe(
        self, remaining_m: float, due_m: float, requested_run_s: float, run_s: float, *, outbound: bool, part: int = 0
    ) -> WayProgress:
        """Return the progress after a cycle.

        Parameters
        ----------
        remaining_m
            Distance left in the direction of the leg or to the goal, m, from any origin.
        due_m
            What the robot has to gain in `STALLED_S`, m.
        requested_run_s, run_s
            When this was requested, and now, by the run's clock, s.
        outbound, part
            Which way the leg leads, and which part of a mission is under way; another one starts anew.
        """
        goes_on = (outbound, part) == (self.outbound, self.part) and requested_run_s <= self.run_s
        if not goes_on or self.best_m is None:
            return WayProgress(outbound, remaining_m, run_s, part, (run_s,))
        gained = (self.best_m - remaining_m) / due_m * STEPS + STEP_TOLERANCE
        if not gained >= 1.0:  # nor is a pose that is not finite
            return self
        steps = int(min(STEPS, gained))
        # What is more than whole steps counts with the next one.
        best_m = remaining_m if steps == STEPS else self.best_m - steps * due_m / STEPS
        return WayProgress(outbound, best_m, run_s, part, (*self.steps_run_s, *[run_s] * steps)[-STEPS:])

    def stalled_s(self, run_s: float) -> float:
        """Return for how long the robot has gained less than is due, s."""
        return 0.0 if self.best_m is None else run_s - next(iter(self.steps_run_s), self.run_s)
