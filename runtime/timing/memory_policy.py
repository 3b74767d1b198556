"""The memory policy: while the robot drives, garbage is collected in slack only, and only the young.

A full collection walks every object there is, which takes longer than a cycle may. So everything alive when the drive
begins is set aside (`gc.freeze`), automatic collection is off, and the few young objects are looked through when a
cycle has just ended and the next one is far enough away.
"""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Callable, Iterator
from typing import Final, Literal

EVERY_CYCLES: Final = 20
"""Young garbage is collected once in so many cycles: there is little, reference counts free the rest at once."""
SLACK_MIN_S: Final = 0.01
"""It takes well below a millisecond; nobody shall ever wait for it."""
GENERATIONS: Final = 3
_YOUNG: Final = 1


def collect_young() -> None:
    """Collect what was made since the last time."""
    gc.collect(_YOUNG)


class MemoryPolicy:
    """Decides when garbage is collected, and keeps the books on it.

    Parameters
    ----------
    collect : callable
        Collects the young.

    Attributes
    ----------
    collections : list of int
        Collections while driving, of each generation; whoever asked for them.
    """

    def __init__(self, collect: Callable[[], object] = collect_young) -> None:
        self._collect = collect
        self.collections = [0] * GENERATIONS
        self._cycles = 0

    @contextlib.contextmanager
    def driving(self) -> Iterator[None]:
        """Set aside what is alive now, and collect nothing but in slack until the end."""
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
        """Collect young garbage if it is time for it and `slack_s` until the next cycle is enough."""
        self._cycles += 1
        if self._cycles >= EVERY_CYCLES and slack_s >= SLACK_MIN_S:
            self._cycles = 0
            self._collect()

    def _count(self, phase: Literal["start", "stop"], info: dict[str, int]) -> None:
        if phase == "start":
            self.collections[info["generation"]] += 1
