"""Names of tracks, and what a person said of them or of a place.

A track gets its number when it is born and keeps it; a person's word on it lasts until it is taken back, however
little the readings say: the track gives way to no other explanation, and to none that stands in its place. Where a
person said that something does not stand, it is not born again before so much new speaks for it as did when it was
rejected.
"""

from __future__ import annotations

import math

from perception.bayes.state import BARRED, BARS, FREE, MARK, NUMBER, NUMBERED, ST, TENTATIVE, State
from perception.kernel import Ints, kernel

POLYGON = 1000
"""What is barred is the radius of this index; from here on the polygon."""


@kernel
def give_number(names: Ints, tally: Ints, row: int) -> None:
    """Give a new track its number."""
    tally[NUMBERED] += 1
    names[row, NUMBER] = tally[NUMBERED]
    names[row, MARK] = 0


@kernel
def give_up(tracks: Ints, names: Ints, t: int, row: int) -> bool:
    """End a track, or make it tentative where a person's word holds it; return whether it has ended.

    Parameters
    ----------
    tracks : (n, ≥ 1) int
        `State.ti` or `State.pi`. Updated.
    names : (m, 2) int
        `State.names`.
    t, row : int
        The track in either.
    """
    if names[row, MARK] == 0:
        tracks[t, ST] = FREE
        return True
    tracks[t, ST] = TENTATIVE
    return False


@kernel
def outlives(names: Ints, row: int, other: int, has_more: bool) -> bool:
    """Tell which of two tracks in one place stays, and have it take the older number: the one of `row` or the other.

    Parameters
    ----------
    names : (m, 2) int
        `State.names`. Updated.
    row, other : int
        The tracks there.
    has_more : bool
        Whether more speaks for the first.

    Returns
    -------
    bool
        Whether the first stays. One that a person spoke of does, and keeps its number.
    """
    if (names[row, MARK] != 0) != (names[other, MARK] != 0):
        return bool(names[row, MARK] != 0)
    if names[row, MARK] == 0:
        older = min(names[row, NUMBER], names[other, NUMBER])
        names[row if has_more else other, NUMBER] = older
    return has_more


@kernel
def is_barred(s: State, x: float, y: float, what: int, llr: float) -> bool:
    """Tell whether a person's word keeps something from being born at (x, y) for which `llr` nat speak."""
    for k in range(min(s.tally[BARS], BARRED)):
        bar = s.barred[k]
        if bar[3] == what and llr < bar[4] and math.hypot(x - bar[0], y - bar[1]) < bar[2]:
            return True
    return False
