"""A known wall goes on beyond an opening: recent echoes on its line become a part of it, if there are enough.

A wall beside a doorway is short, and seen alone its echoes might as well be those of a barrel. But a barrel would
touch the line of a known wall by chance, so that they need not prove that they lie on a straight line.
"""

from __future__ import annotations

import math
from typing import Any

from numpy.typing import NDArray

from perception.bayes.settings_record import SettingsRecord
from perception.bayes.state import Memory, StateRecord
from perception.bayes.wall_contact import (
    BEAM_EDGE,
    FOOT,
    SPAN_MARGIN_M,
    contact,
    distance_and_foot,
    edges_answer,
    is_on_span,
    line_variance,
    tolerance,
    wall_normal,
    wall_point,
)
from perception.bayes.wall_evidence import SPAN_CHI2_MIN
from perception.bayes.wall_fit import fit_walls
from perception.bayes.wall_initiation import end_candidate, fit_candidate
from perception.bayes.wall_merging import SAME_SIGMAS, SAME_SLACK_M, move_bins
from perception.bayes.wall_records import CANDIDATE, MAX_WALLS
from perception.bayes.wall_review import is_reviewed
from perception.kernel import kernel


@kernel
def continued_wall(s: StateRecord, p: SettingsRecord, newest: int) -> int:
    """Return the known wall whose line a recent echo touches beyond its ends, −1 if there is none.

    Parameters
    ----------
    s, p
        Memory and settings; the candidate becomes that line.
    newest : int
        The echo's place among the recent readings.
    """
    room = s[0].room
    q = room.recent[newest].reading
    edges = edges_answer(room)
    for k in range(MAX_WALLS):
        wall = room.walls[k]
        if not is_reviewed(wall):
            continue
        kind, expected, along, dot = contact(wall, q, p)
        is_touched = kind == FOOT or (kind == BEAM_EDGE and edges)
        if not is_touched or is_on_span(wall, along, SPAN_MARGIN_M):
            continue
        if abs(q.range_m - expected) < tolerance(room, wall, along, expected, dot):
            part = room.walls[CANDIDATE]
            part.normal_x, part.normal_y = wall_normal(wall)
            part.origin_x, part.origin_y = wall_point(wall, along)
            part.offset = part.slope = part.covariance = 0.0
            part.variance_offset = line_variance(wall, along)
            part.variance_slope = wall.variance_slope
            return k
    return -1


@kernel
def is_in_line(s: StateRecord, k: int) -> bool:
    """Return whether the spans of the candidate lie on the line of wall `k`."""
    wall = s[0].room.walls[k]
    part = s[0].room.walls[CANDIDATE]
    for i in range(2 * part.span_count):
        span = part.spans[i // 2]
        u = span.low if i % 2 == 0 else span.high
        x, y = wall_point(part, u)
        away, along = distance_and_foot(wall, x, y)
        sigma = math.sqrt(line_variance(wall, along) + line_variance(part, u))
        if abs(away) > SAME_SIGMAS * sigma + SAME_SLACK_M:
            return False
    return True


def continue_wall(memory: Memory, p: SettingsRecord, newest: int) -> bool:
    """Look for a part of a known wall beyond an opening, through a recent echo; add it to the wall if there is one.

    Parameters
    ----------
    memory, p
        Updated, and the settings.
    newest : int
        The echo's place among the recent readings.

    Returns
    -------
    bool
        Whether there is one.
    """
    k = continued_wall(memory.s, p, newest)
    if k < 0:
        return False
    is_part = fit_candidate(memory, p, SPAN_CHI2_MIN) and is_in_line(memory.s, k)
    if is_part:
        walls: NDArray[Any] = memory.state["room"]["walls"][0]
        move_bins(walls[k], walls[CANDIDATE])
        fit_walls(memory.s, p, k, k + 1, 1)
    end_candidate(memory.s, is_part)
    return is_part
