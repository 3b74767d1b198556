"""When the next cycle is due: with the ring's next echo while echoes come, on a grid of its own while none do.

A timer that knows nothing of the ring lets each echo wait for half a period on average. So while echoes come, an
echo begins the cycle; which one, the period says. Two bounds hold whatever comes: cycles are never nearer to each
other than half a step before their time (no burst), and a deadline stands behind every echo that is waited for (the
base's deadman is fed). A pacer reads no clock, so that all of it can be tried in virtual time.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

EARLY: Final = 0.5
"""An echo may begin a cycle so much of a step before the cycle's time; one that comes earlier waits for the next."""

PATIENCE: Final = 0.25
"""An expected echo is waited for so much of a step longer; then the cycle begins without it."""

LOST_STEPS: Final = 2.5
"""After so many steps without an echo there is nothing to follow any more."""

ROUNDING: Final = 1e-9
"""Of times in seconds: a deadline that is a whole number of periods away must count as that many."""


class CycleStart(NamedTuple):
    """How a cycle began."""

    due_s: float
    """When it should have, s."""
    late_s: float
    """How much later it did, s; never below zero."""
    missed: int
    """Cycles that should have been and were not, before it."""
    echo_age_s: float | None
    """How long the oldest echo that it takes in has waited, s; None where none came."""


class Pacer:
    """Decides when cycles begin.

    Parameters
    ----------
    begin_s : float
        When the first cycle is due, s.
    period_s : float
        The cycle's own period, s.
    step_s : float, optional
        The ring's time from firing to firing, s. Where it is given, cycles follow the echoes: every cycle takes as
        many steps as come nearest to the period, or every step as many cycles.
    cycle_gap_max_s : float
        Patience never makes two cycles farther apart than this, or the period where that is longer, s.
    """

    def __init__(
        self, begin_s: float, period_s: float, step_s: float | None = None, cycle_gap_max_s: float = math.inf
    ) -> None:
        self._own_s = period_s
        self._step_s = period_s if step_s is None else step_s
        self._follows = step_s is not None
        self._gap_s = max(period_s, cycle_gap_max_s)
        if self._step_s <= period_s:
            self._locked_s = round(period_s / self._step_s) * self._step_s
        else:
            self._locked_s = self._step_s / round(self._step_s / period_s)
        self._begun_s: float | None = None
        self._due_s = begin_s
        self._deadline_s = begin_s
        self._called_s: float | None = None
        self._oldest_s: float | None = None
        self._echo_s: float | None = None
        self._is_locked = False
        self.missed = 0
        """Cycles that should have been and were not."""

    @property
    def deadline_s(self) -> float:
        """When the next cycle begins at the latest: now and before where an echo calls for it, s."""
        return self._deadline_s

    @property
    def due_s(self) -> float:
        """When the next cycle should begin: with the expected echo, or at its own time, s."""
        return self._due_s

    @property
    def period_s(self) -> float:
        """The time from cycle to cycle as things stand, s."""
        return self._locked_s if self._is_locked else self._own_s

    @property
    def is_locked(self) -> bool:
        """True while cycles follow the echoes."""
        return self._is_locked

    def hear(self, run_s: float, held_since_s: float | None = None) -> None:
        """Take note of an echo: it begins the next cycle at once unless it comes too early for that.

        Parameters
        ----------
        run_s : float
            When it was read, s.
        held_since_s : float, optional
            Since when nobody looked, s: it may have been there as long. Then it counts as having come when it was
            expected.
        """
        arrived_s = run_s
        if held_since_s is not None:
            arrived_s = min(run_s, max(self._due_s, held_since_s))
        if self._begun_s is not None:
            # A deadline behind us means that nobody looked, whatever held the loop.
            arrived_s = min(arrived_s, max(self._deadline_s, self._begun_s))
        if self._oldest_s is None:
            self._oldest_s = arrived_s
        self._echo_s = arrived_s
        if self._called_s is not None or not self._follows:
            return
        if self._begun_s is None or run_s >= self._begun_s + self._earliest_s - ROUNDING:
            self._called_s = arrived_s
            self._deadline_s = run_s
        else:
            self._plan(self._begun_s)

    def begin(self, run_s: float) -> CycleStart:
        """Begin a cycle at `run_s`, and plan the next one."""
        due_s = self._deadline_s if self._called_s is None else self._called_s
        # What comes so late that it is too early for the next one to follow takes the next one's place.
        missed = max(0, math.floor((run_s - self._due_s + EARLY * self._slot_s) / self.period_s + ROUNDING))
        age_s = None if self._oldest_s is None else run_s - self._oldest_s
        self.missed += missed
        self._begun_s = run_s
        self._called_s = self._oldest_s = None
        self._plan(run_s)
        return CycleStart(due_s, max(0.0, run_s - due_s), missed, age_s)

    def advance(self, run_s: float) -> float:
        """End a cycle at `run_s`: leave out deadlines that have passed meanwhile, and return the one ahead."""
        if self._called_s is None and self._deadline_s <= run_s:
            behind = math.floor((run_s - self._deadline_s) / self.period_s + ROUNDING) + 1
            ahead_s = self._deadline_s + behind * self.period_s
            latest_s = math.inf if self._begun_s is None or not self._is_locked else self._begun_s + self._gap_s
            self._deadline_s = max(run_s, min(ahead_s, latest_s))
        return self._deadline_s

    @property
    def _slot_s(self) -> float:
        """The time in which one cycle's call is expected at most: a step, or a period where that is shorter."""
        return min(self._step_s, self._locked_s) if self._is_locked else self._own_s

    @property
    def _earliest_s(self) -> float:
        """How long after the last cycle an echo may begin the next one."""
        return self._locked_s - EARLY * min(self._step_s, self._locked_s)

    def _plan(self, begun_s: float) -> None:
        """Plan the cycle after the one that began at `begun_s`."""
        before_s, self._is_locked = self._due_s, self._hears(begun_s)
        if not self._is_locked or self._echo_s is None:
            behind = math.floor((begun_s - before_s) / self._own_s + EARLY + ROUNDING)
            self._due_s = before_s + (max(0, behind) + 1) * self._own_s
            self._deadline_s = self._due_s
            return
        earliest_s = begun_s + self._earliest_s
        expected_s = self._echo_s + math.ceil((earliest_s - self._echo_s) / self._step_s) * self._step_s
        if expected_s <= begun_s + self._locked_s + EARLY * self._slot_s:
            self._due_s = expected_s
            self._deadline_s = min(expected_s + PATIENCE * self._slot_s, max(begun_s + self._gap_s, expected_s))
        else:
            self._due_s = self._deadline_s = begun_s + self._locked_s

    def _hears(self, run_s: float) -> bool:
        """Say whether there are echoes to follow."""
        if not self._follows or self._echo_s is None:
            return False
        return run_s - self._echo_s <= LOST_STEPS * max(self._step_s, self._locked_s) + ROUNDING
