"""Thread time of pieces of work, judged in pairs or repeated, so that a busy machine fails no test.

A thread is charged for more than its own work: other programs empty its caches, interrupts are served on its account,
and the host of a virtual machine takes time away. Two rules make a false alarm rarer than 1 in 10^5 runs.

`median_ratio`: work and control take turns, so that both meet the same machine; every limit is at least twice what
is measured. Beside eighteen busy processes at most 1 pair in 6 was beyond its limit. For the median of 80 pairs to be
beyond it, 40 of them must be: even with 1 in 5, P(Binomial(80, 1/5) ≥ 40) < 3·10^-9.

`always_beyond`: the same pieces of work are repeated, up to six times; what is beyond its limit each time is the
work's own. Of 6,000 pieces beside eighteen busy processes one was. Even with 1 in 200, all six times:
(1/200)^6 < 2·10^-14 for a piece, 2·10^-10 for 10,000 pieces.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

REPETITIONS_MAX: Final = 6
_SCRATCH: Final = np.random.default_rng(1).random(4096)


def thread_ms(work: Callable[[], object]) -> float:
    """Do some work and return its thread time, ms."""
    begin_ns = time.thread_time_ns()
    work()
    return 1e-6 * (time.thread_time_ns() - begin_ns)


def control_ms() -> float:
    """Return the thread time of a fixed piece of interpreter and array work, ms: a measure of the machine's speed."""
    return thread_ms(_control)


def _control() -> None:
    total = 0.0
    for k in range(1000):
        total += k * 0.5
    np.sort(_SCRATCH)


def median_ratio(work_ms: Sequence[float], control: Sequence[float]) -> float:
    """Return the median of how long each piece of work took beside the control measured next to it."""
    return float(np.median(np.asarray(work_ms) / np.asarray(control)))


def always_beyond(measure: Callable[[], tuple[Sequence[float], float]]) -> set[int]:
    """Return which pieces of work are beyond their limit every time; none of them as soon as each was within once.

    Parameters
    ----------
    measure
        Does the same pieces of work each time, and returns what each took and the limit.
    """
    beyond: set[int] | None = None
    for _ in range(REPETITIONS_MAX):
        taken, limit = measure()
        now = set(np.flatnonzero(np.asarray(taken) > limit).tolist())
        beyond = now if beyond is None else beyond & now
        if not beyond:
            break
    return beyond or set()
