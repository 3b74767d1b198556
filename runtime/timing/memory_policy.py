"""The policy of garbage collection: while the robot drives, only the young generation is collected, between cycles.

A full collection visits every object, which takes longer than a cycle may. So all objects alive when the drive begins
are excluded (`gc.freeze`), automatic collection is off, and the few young objects are collected when a cycle has just
ended and the next one is far enough away.
"""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Callable, Iterator
from typing import Final, Literal

EVERY_CYCLES: Final = 20
"""Cycles from one collection to the next: garbage is rare, as reference counts free most objects at once."""
SLACK_MIN_S: Final = 0.01
"""Least time until the next cycle for a collection, which takes well below a millisecond, s."""
GENERATIONS: Final = 3
_YOUNG: Final = 1


def collect_young() -> None:
    """Collect the objects made since the last collection."""
    gc.collect(_YOUNG)


class MemoryPolicy:
    """Decides when garbage is collected, and counts collections.

    Parameters
    ----------
    collect : callable
        Collects the young generation.

    Attributes
    ----------
    collections : list of int
        Collections while driving, of each generation, also those that others requested.
    """

    def __init__(self, collect: Callable[[], object] = collect_young) -> None:
        self._collect = collect
        self.collections = [0] * GENERATIONS
        self._cycles = 0

    @contextlib.contextmanager
    def driving(self) -> Iterator[None]:
        """Exclude what is alive now, and collect only in `cycle_done` inside this context."""
        gc.collect()
        gc.freeze()
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

    def cycle_done(self, slack_s: float) -> None:
        """Collect the young generation where it is due and the next cycle is `SLACK_MIN_S` away or more."""
        self._cycles += 1
        if self._cycles >= EVERY_CYCLES and slack_s >= SLACK_MIN_S:
            self._cycles = 0
            self._collect()

    def _count(self, phase: Literal["start", "stop"], info: dict[str, int]) -> None:
        if phase == "start":
            self.collections[info["generation"]] += 1
