"""Numbers of walls: one for each span that is long enough to be reported, of the same sequence as those of tracks.

The spans of a wall are found anew at each fit. So its bins remember the number of the span that held them last. A
span has the oldest number among its bins; where an opening divides a span, the longer part keeps its number.
"""

from __future__ import annotations

from typing import Final

from perception.bayes.memory.state import StateRecord
from perception.bayes.memory.wall_records import Wall
from perception.kernel import kernel

SPAN_MIN_M: Final = 0.29
"""Least length of a span that is reported, and that gets a number."""


@kernel
def has_number(wall: Wall, number: int) -> bool:
    """Return whether one of a wall's spans has this number."""
    has = False
    for k in range(wall.span_count):
        has = has or wall.spans[k].number == number
    return has


@kernel
def number_spans(s: StateRecord, k: int) -> None:
    """Give each span of a wall its number, after the spans were found anew.

    Parameters
    ----------
    s : (1,) State
        Updated.
    k : int
        The wall's place.
    """
    wall = s[0].room.walls[k]
    for i in range(wall.span_count):
        wall.spans[i].number = 0
    for _ in range(wall.span_count):
        longest = -1
        length = SPAN_MIN_M
        for i in range(wall.span_count):
            span = wall.spans[i]
            if span.number == 0 and span.high - span.low >= length:
                longest = i
                length = span.high - span.low
        if longest < 0:
            return
        span = wall.spans[longest]
        oldest = 0
        for b in range(span.first_bin, span.end_bin):
            number = wall.bins[b].number
            if number > 0 and (oldest == 0 or number < oldest) and not has_number(wall, number):
                oldest = number
        if oldest == 0:
            s[0].objects_numbered += 1
            oldest = s[0].objects_numbered
        span.number = oldest
        for b in range(span.first_bin, span.end_bin):
            wall.bins[b].number = oldest
