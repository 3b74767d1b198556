"""How much refinement a cycle may do where no clock on the wall decides: so many quanta, or so much processor time.

Counted quanta make one seed one run. Processor time is what a budget means without the other programs that share the
machine; it is measured, so that a run under it is not repeatable to the bit.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final, Protocol

QUANTA_PER_CYCLE: Final = 50
"""What the default budget affords on a slow machine; virtual time needs a number instead of a clock."""


def enough_quanta(done: int) -> bool:
    """Say whether refinement may go on after `done` quanta of a cycle."""
    return done < QUANTA_PER_CYCLE


class RefinementBudget(Protocol):
    """Says, quantum by quantum, whether refinement may go on."""

    def begin(self) -> None:
        """Begin a cycle."""
        ...

    def __call__(self, done: int, /) -> bool:
        """Say whether there may be another quantum after `done` in this cycle."""
        ...


class Quanta:
    """So many quanta a cycle; of a quarter, one in every fourth cycle.

    Parameters
    ----------
    most : float
        Whole quanta that are not used are not saved up.
    """

    def __init__(self, most: float) -> None:
        self._most = most
        self._left = 0.0

    def begin(self) -> None:
        """Begin a cycle."""
        self._left = min(self._left + self._most, max(self._most, 1.0))

    def __call__(self, _done: int) -> bool:
        """Say whether there may be another quantum, and count it."""
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class ProcessorTime:
    """So much time a cycle, the part of perception that always runs included, as in the robot's own process.

    Parameters
    ----------
    budget_s : float
        For a cycle, s.
    clock : callable
        Monotonic, s: the processor time of this thread where not given.
    """

    def __init__(self, budget_s: float, clock: Callable[[], float] = time.thread_time) -> None:
        self._budget_s = budget_s
        self._clock = clock
        self._end_s = 0.0

    def begin(self) -> None:
        """Begin a cycle now."""
        self._end_s = self._clock() + self._budget_s

    def __call__(self, _done: int) -> bool:
        """Say whether there is time left in this cycle."""
        return self._clock() < self._end_s
