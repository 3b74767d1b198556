"""The refinement budget of a cycle in virtual time: a number of quanta, or an amount of CPU time.

Counted quanta make a run repeatable to the bit. CPU time is what a budget means without the other programs that share
the machine; it is measured, so that a run under it is not repeatable.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final, Protocol

QUANTA_PER_CYCLE: Final = 50
"""Quanta that fit the default budget on a slow machine; virtual time needs a number instead of a clock."""


def within_quanta_per_cycle(done: int) -> bool:
    """Return whether refinement may continue after `done` quanta of a cycle."""
    return done < QUANTA_PER_CYCLE


class RefinementBudget(Protocol):
    """Decides, quantum by quantum, whether refinement may continue."""

    def begin(self) -> None:
        """Begin a cycle."""
        ...

    def __call__(self, done: int, /) -> bool:
        """Return whether there may be another quantum after `done` in this cycle."""
        ...


class QuantumBudget:
    """A number of quanta a cycle; with a quarter, one in every fourth cycle.

    Whole quanta that are not used in a cycle are lost.
    """

    def __init__(self, per_cycle: float) -> None:
        self._per_cycle = per_cycle
        self._left = 0.0

    def begin(self) -> None:
        """Begin a cycle."""
        self._left = min(self._left + self._per_cycle, max(self._per_cycle, 1.0))

    def __call__(self, _done: int) -> bool:
        """Return whether there may be another quantum, and count it."""
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class CpuTimeBudget:
    """An amount of time a cycle, the part of perception that always runs included, as in the robot's own process.

    Parameters
    ----------
    budget_s : float
        For a cycle, s.
    clock : callable
        Monotonic, s; by default the CPU time of this thread.
    """

    def __init__(self, budget_s: float, clock: Callable[[], float] = time.thread_time) -> None:
        self._budget_s = budget_s
        self._clock = clock
        self._end_s = 0.0

    def begin(self) -> None:
        """Begin a cycle now."""
        self._end_s = self._clock() + self._budget_s

    def __call__(self, _done: int) -> bool:
        """Return whether there is time left in this cycle."""
        return self._clock() < self._end_s
