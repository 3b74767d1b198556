"""Which object a quantum of refinement goes to: the one that gains most by it, and in the end every one.

Worth is unseen evidence for an object's size, more where its place is unsure; among those worth a quantum the nearer
to the robot goes first, as it is what the robot meets next. A budget that is spent in every cycle would leave some
waiting for ever: whoever was passed over too often goes before all others, longest wait first, so that nobody waits
for more than `PATIENCE` quanta and one for each other object.
"""

from __future__ import annotations

import math
from typing import Final

from config.units import FOOT_M
from perception.bayes.state import (
    DIRTY,
    FREE,
    HERE_X,
    HERE_Y,
    NRES,
    PASSED,
    POLISH,
    PROB,
    QUIET,
    R00,
    R11,
    ST,
    TX,
    TY,
    Settings,
    State,
)
from perception.kernel import Ints, kernel

UNSURE: Final = 4.0
UNSURE_ROOT_M: Final = 0.03 * FOOT_M
"""Evidence counts so many times where an object's place is less sure than this, maybe altogether wrong."""
CERTAIN: Final = 0.95
"""Or where its name is less sure than this."""
SIZE: Final = 8.0
"""A small object's readings are taken for so many more."""
OWED: Final = 1e-6
"""By so much what is worked off to the end is above the threshold by itself."""
PATIENCE: Final = 60
"""Quanta that may go to others; then an object goes before all that are not passed over as often."""
OVERDUE: Final = 1e9


@kernel
def news(track: Ints, quiet: int, threshold: float, weight: float) -> float:
    """Return what is unseen of a track for its size, `weight` times; `track` is a row of `State.ti` or `State.pi`.

    A track that has had no evidence for a while is worked off to the end: whatever is unseen, and a few rounds more.
    """
    v: float = weight * (track[DIRTY] / (track[NRES] + SIZE))
    if track[QUIET] > quiet and track[POLISH] > 0:
        v += threshold + OWED
    return v


@kernel
def worth(s: State, p: Settings, t: int, threshold: float) -> float:
    """Return what a quantum is worth to circle `t`; it waits for one where that is above `threshold`."""
    if s.ti[t, ST] == FREE:
        return 0.0
    is_unsure = max(s.tf[t, R00], s.tf[t, R11]) > UNSURE_ROOT_M or s.tf[t, PROB] < CERTAIN
    return news(s.ti[t], p.quiet, threshold, UNSURE if is_unsure else 1.0)


@kernel
def worth_polygon(s: State, p: Settings, t: int, threshold: float) -> float:
    """Return the same for polygon `t`."""
    return 0.0 if s.pi[t, ST] == FREE else news(s.pi[t], p.quiet, threshold, 1.0)


@kernel
def rank(s: State, p: Settings, v: float, x: float, y: float, passed: int) -> float:
    """Return the place in the row of something of worth `v` at (x, y), passed over so often: the largest is next.

    At the end of the ring's reach it counts half as much as beside the robot.
    """
    if passed > PATIENCE:
        return OVERDUE + passed
    return v * p.range_max / (p.range_max + math.hypot(x - s.g[HERE_X], y - s.g[HERE_Y]))


@kernel
def is_waiting(s: State, p: Settings, threshold: float) -> bool:
    """Tell whether a circle waits for a quantum."""
    most = 0.0
    for t in range(s.ti.shape[0]):
        most = max(most, worth(s, p, t, threshold))
    return bool(most > threshold)


@kernel
def choose(s: State, p: Settings, threshold: float) -> int:
    """Return the circle whose turn it is, −1 where none waits; the others that wait have been passed over."""
    best = -1.0
    chosen = -1
    for t in range(s.ti.shape[0]):
        v = worth(s, p, t, threshold)
        if v > threshold:
            v = rank(s, p, v, s.tf[t, TX], s.tf[t, TY], s.ti[t, PASSED])
            s.ti[t, PASSED] += 1
            if v > best:
                best = v
                chosen = t
    if chosen >= 0:
        s.ti[chosen, PASSED] = 0
    return chosen


@kernel
def choose_polygon(s: State, p: Settings, threshold: float) -> int:
    """Return the polygon whose turn it is, as `choose` does the circle, but near or far alike.

    Polygons that face each other across the way share readings: where the nearer went first, one was found twice.
    """
    best = -1.0
    chosen = -1
    for t in range(s.pi.shape[0]):
        v = worth_polygon(s, p, t, threshold)
        if v > threshold:
            v = OVERDUE + s.pi[t, PASSED] if s.pi[t, PASSED] > PATIENCE else v
            s.pi[t, PASSED] += 1
            if v > best:
                best = v
                chosen = t
    if chosen >= 0:
        s.pi[chosen, PASSED] = 0
    return chosen
