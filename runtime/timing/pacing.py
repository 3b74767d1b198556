"""The pacer: schedules the next cycle with the ring's next echo, or on a fixed grid while no echoes arrive.

With a timer independent of the ring, each echo would wait for half a period on average. So while echoes arrive, an
echo begins the cycle; the period determines which one. Two bounds always hold: cycles are never closer to each other
than half a step before their time (no burst), and there is a deadline behind every awaited echo (commands reach the
base before its deadman trips). A pacer reads no clock: all its times are the run's, and it can be tested in virtual
time.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

EARLY: Final = 0.5
"""Share of a step by which an echo may begin a cycle before its time; an earlier echo waits for the next one."""

ECHO_WAIT_SHARE: Final = 0.25
"""Wait this fraction of a step past the expected echo; then the cycle begins without it."""

LISTEN_SHARE: Final = 0.25
"""Before an echo is due by more than this fraction of a step, the line need not be read."""

LOST_STEPS: Final = 2.5
"""Steps without an echo after which cycles return to their own grid."""

ROUNDING: Final = 1e-9
"""Tolerance of times, s: a deadline that is a whole number of periods away must count as that many."""


class CycleStart(NamedTuple):
    """How a cycle began."""

    due_s: float
    """When it should have started, by the run's clock."""
    late_s: float
    """How much later it did, s; never below zero."""
    missed: int
    """Cycles before it that were due and did not take place."""
    echo_age_s: float | None
    """How long the oldest echo that it takes in has waited, s; None without an echo."""


class Pacer:
    """Decides when cycles begin; all moments are the run's clock's.

    Parameters
    ----------
    begin_s : float
        When the first cycle is due.
    period_s : float
        The cycle's own period, s.
    step_s : float, optional
        The ring's time from firing to firing, s. Where it is given, cycles follow the echoes: every cycle takes the
        number of steps nearest to the period, or every step that number of cycles.
    cycle_gap_max_s : float
        Waiting for an echo never makes two cycles farther apart than this, or the period where that is longer, s.
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
        """Time from cycle to cycle while they follow the echoes."""
        self._last_begin_s: float | None = None
        self._due_s = begin_s
        self._deadline_s = begin_s
        self._called_s: float | None = None
        """Arrival of the echo that begins the next cycle at once; None where none calls for it yet."""
        self._oldest_s: float | None = None
        """Arrival of the first echo since the last cycle began, None without one; and of the last echo of all."""
        self._echo_s: float | None = None
        self._is_locked = False
        self.missed = 0
        """Cycles that were due and did not take place."""

    @property
    def deadline_s(self) -> float:
        """When the next cycle begins at the latest; not after now where an echo calls for it."""
        return self._deadline_s

    @property
    def due_s(self) -> float:
        """When the next cycle should begin: with the expected echo, or at its own time."""
        return self._due_s

    @property
    def period_s(self) -> float:
        """The present time from cycle to cycle, s."""
        return self._locked_s if self._is_locked else self._own_s

    @property
    def is_locked(self) -> bool:
        """True while cycles follow the echoes."""
        return self._is_locked

    @property
    def quiet_until_s(self) -> float:
        """Until when no echo is expected, so that the line need not be read; −inf where that is not known."""
        if not self._is_locked or self._echo_s is None or self._last_begin_s is None:
            return -math.inf
        if self._last_begin_s - self._echo_s > EARLY * self._slot_s:
            return -math.inf  # the cycle began without its echo, which may come at any time
        return min(self._due_s, self._echo_s + self._step_s) - LISTEN_SHARE * self._slot_s

    def on_echo(self, run_s: float, busy_since_s: float | None = None) -> None:
        """Count an echo: it begins the next cycle at once unless it comes too early for that.

        Parameters
        ----------
        run_s : float
            When it was read.
        busy_since_s : float, optional
            Since when the loop has been busy and has not read the line: the echo may have arrived as early. Then it
            counts as having arrived when it was expected.
        """
        arrived_s = run_s
        if busy_since_s is not None:
            arrived_s = min(run_s, max(self._due_s, busy_since_s))
        if self._last_begin_s is not None:
            # A deadline in the past means that the line was not read, whatever delayed the loop.
            arrived_s = min(arrived_s, max(self._deadline_s, self._last_begin_s))
        if self._oldest_s is None:
            self._oldest_s = arrived_s
        self._echo_s = arrived_s
        if self._called_s is not None or not self._follows:
            return
        if self._last_begin_s is None or run_s >= self._last_begin_s + self._earliest_s - ROUNDING:
            self._called_s = arrived_s
            self._deadline_s = run_s
        else:
            self._plan(self._last_begin_s)

    def begin(self, run_s: float) -> CycleStart:
        """Begin a cycle at `run_s`, plan the next one, and return how it begins."""
        due_s = self._deadline_s if self._called_s is None else self._called_s
        # A cycle so late that the next one would follow too early takes the next one's place.
        missed = max(0, math.floor((run_s - self._due_s + EARLY * self._slot_s) / self.period_s + ROUNDING))
        age_s = None if self._oldest_s is None else run_s - self._oldest_s
        self.missed += missed
        self._last_begin_s = run_s
        self._called_s = self._oldest_s = None
        self._plan(run_s)
        return CycleStart(due_s, max(0.0, run_s - due_s), missed, age_s)

    def advance(self, run_s: float) -> float:
        """End a cycle at `run_s`: skip deadlines that have passed meanwhile, and return the next one."""
        if self._called_s is None and self._deadline_s <= run_s:
            behind = math.floor((run_s - self._deadline_s) / self.period_s + ROUNDING) + 1
            ahead_s = self._deadline_s + behind * self.period_s
            latest_s = (
                math.inf if self._last_begin_s is None or not self._is_locked else self._last_begin_s + self._gap_s
            )
            self._deadline_s = max(run_s, min(ahead_s, latest_s))
        return self._deadline_s

    @property
    def _slot_s(self) -> float:
        """The longest time in which one cycle's echo is expected: a step, or a period where that is shorter."""
        return min(self._step_s, self._locked_s) if self._is_locked else self._own_s

    @property
    def _earliest_s(self) -> float:
        """How long after the last cycle an echo may begin the next one."""
        return self._locked_s - EARLY * min(self._step_s, self._locked_s)

    def _plan(self, begin_s: float) -> None:
        """Plan the cycle after the one that began at `begin_s`: when it is due, and its deadline.

        It is due with the first expected echo that does not come too early, or else on the grid of its own period.
        """
        before_s, self._is_locked = self._due_s, self._has_echoes(begin_s)
        if not self._is_locked or self._echo_s is None:
            behind = math.floor((begin_s - before_s) / self._own_s + EARLY + ROUNDING)
            self._due_s = before_s + (max(0, behind) + 1) * self._own_s
            self._deadline_s = self._due_s
            return
        earliest_s = begin_s + self._earliest_s
        expected_s = self._echo_s + math.ceil((earliest_s - self._echo_s) / self._step_s) * self._step_s
        if expected_s <= begin_s + self._locked_s + EARLY * self._slot_s:
            self._due_s = expected_s
            latest_s = max(begin_s + self._gap_s, expected_s)
            self._deadline_s = min(expected_s + ECHO_WAIT_SHARE * self._slot_s, latest_s)
        else:
            self._due_s = self._deadline_s = begin_s + self._locked_s

    def _has_echoes(self, run_s: float) -> bool:
        """Return whether there are echoes to follow."""
        if not self._follows or self._echo_s is None:
            return False
        return run_s - self._echo_s <= LOST_STEPS * max(self._step_s, self._locked_s) + ROUNDING
