"""The best poses that a search has found so far, apart from each other."""

from __future__ import annotations

import math
from typing import Annotated, Final

from perception.bounds import FINITE, Finite, Place, index_of, up_to
from perception.kernel import kernel
from perception.records import Record, Records

STARTS_MAX: Final = 200
"""Starts that a search keeps, the best ones."""
PROFILES_MAX: Final = 2
"""Guesses of the causes of readings that a search tries."""
START_APART_M: Final = 0.3
"""Starts nearer to each other than this on each axis, in heading than `START_APART_RAD`, are one: one and a half
steps of the search."""
START_APART_RAD: Final = math.radians(9.0)
"""Difference of headings in `START_APART_M`."""


class Start(Record):
    """A pose (m, rad) and how well the readings fit there, nat."""

    x: Place
    y: Place
    heading: Place
    score: Finite
    profile: Annotated[int, index_of(PROFILES_MAX)]
    """By which of the search's guesses of the causes of readings."""


class Starts(Record):
    """The best poses found so far, in any order."""

    count: Annotated[int, up_to(STARTS_MAX)]
    least: Annotated[float, FINITE._replace(infinite=True)]
    """Score of the worst one if there is no room for more, otherwise -inf: a start must be better."""
    starts: Annotated[Records[Start], STARTS_MAX]


@kernel
def offer(to: Records[Starts], x: float, y: float, heading: float, score: float, profile: int) -> None:
    """Add a start, unless a better one is near it or all are better; it replaces a worse one near it.

    Parameters
    ----------
    to : (1,) Starts
        Updated.
    x, y, heading, score, profile : float, int
        As of `Start`.
    """
    if score <= to[0].least:
        return
    starts, worst = to[0].starts, 0
    for k in range(to[0].count):
        other = starts[k]
        turn = abs((heading - other.heading + math.pi) % (2.0 * math.pi) - math.pi)
        if abs(x - other.x) < START_APART_M and abs(y - other.y) < START_APART_M and turn < START_APART_RAD:
            if score > other.score:
                other.x, other.y, other.heading, other.score, other.profile = x, y, heading, score, profile
            return
        if other.score < starts[worst].score:
            worst = k
    if to[0].count < STARTS_MAX:
        worst = to[0].count
        to[0].count += 1
    at = starts[worst]
    at.x, at.y, at.heading, at.score, at.profile = x, y, heading, score, profile
    if to[0].count == STARTS_MAX:
        to[0].least = score
        for k in range(STARTS_MAX):
            to[0].least = min(to[0].least, starts[k].score)
