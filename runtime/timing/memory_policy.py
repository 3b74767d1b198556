"""The policy of garbage collection: while the robot drives, only what is recent is collected, between cycles.

A collection of all objects takes longer than a cycle may. So automatic collection is off, and two sets of objects
are excluded for the whole drive (`gc.freeze`): those alive when it begins, and those that its first minute leaves.
What is made after that is collected when a cycle has just ended and the next one is far enough away: the youngest
objects each second, and once a minute the others, such as those of a page of the console that was closed.
"""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Callable, Iterator
from typing import Final, Literal

EVERY_CYCLES: Final = 20
"""Cycles from one collection to the next: garbage is rare, as reference counts free most objects at once."""
OLD_EVERY_CYCLES: Final = 1200
"""Cycles until what the drive has made is excluded, and then from one collection of older objects to the next."""
SLACK_MIN_S: Final = 0.01
"""Least time until the next cycle for a collection, which takes well below a millisecond, s."""
GENERATIONS: Final = 3
_YOUNG: Final = 1
_OLD: Final = 2


@contextlib.contextmanager
def no_collection() -> Iterator[None]:
    """Collect nothing meanwhile: a start makes hundreds of thousands of objects, and nearly all of them stay."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()


class MemoryPolicy:
    """Decides when garbage is collected, and counts collections.

    Parameters
    ----------
    collect : callable
        Collects the objects of a generation and of the younger ones.
    """

    def __init__(self, collect: Callable[[int], object] = gc.collect) -> None:
        self._collect = collect
        self.collections = [0] * GENERATIONS
        """Collections while driving, of each generation, also those that others requested."""
        self._cycles = 0
        self._old_cycles = 0
        self._settled = False

    @contextlib.contextmanager
    def driving(self) -> Iterator[None]:
        """Exclude what is alive now, and collect only in `cycle_done` inside this context."""
        gc.freeze()  # without a collection first: it takes a tenth of a second, and imports leave little garbage
        self._old_cycles, self._settled = 0, False
        was_enabled = gc.isenabled()
        gc.disable()
        gc.callbacks.append(self._count)
        try:
            yield
        finally:
            gc.callbacks.remove(self._count)
            if was_enabled:
                gc.enable()
            gc.unfreeze()

    def settle(self) -> None:
        """Exclude what is alive now, as at the start."""
        gc.freeze()
        self._cycles = self._old_cycles = 0
        self._settled = False

    def cycle_done(self, slack_s: float) -> None:
        """Collect what is due if the next cycle is `SLACK_MIN_S` away or more."""
        self._cycles += 1
        self._old_cycles += 1
        if self._cycles < EVERY_CYCLES or slack_s < SLACK_MIN_S:
            return
        self._cycles = 0
        if self._old_cycles < OLD_EVERY_CYCLES:
            self._collect(_YOUNG)
            return
        self._old_cycles = 0
        if self._settled:
            self._collect(_OLD)
        else:
            self._settled = True
            gc.freeze()

    def _count(self, phase: Literal["start", "stop"], info: dict[str, int]) -> None:
        if phase == "start":
            self.collections[info["generation"]] += 1
