"""New walls from recent echoes that nothing explains: lines through two of them, scored by all recent readings.

Two ranges have two common tangents, and two ends of beam edges have a line. The line that most recent echoes support
is fitted to them in three rounds; it becomes a wall if it is long, straight, and not passed through.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from perception.bayes.memory.elements import Reading
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import Memory, StateRecord
from perception.bayes.memory.wall_records import (
    CANDIDATE,
    GOLDEN_RATIO,
    IS_FREE,
    IS_KNOWN,
    IS_TAKEN,
    MAX_WALLS,
    RECENT_READINGS_MAX,
    WALL_BINS,
)
from perception.bayes.walls.bins import SILENT_PASS, bin_of, clear_wall, enter_reading
from perception.bayes.walls.contact import (
    FIT_ROUNDS,
    FOOT,
    NOWHERE,
    SLANTING_MIN_COS,
    contact,
    edges_answer,
    line_variance,
    tolerance,
    wall_normal,
)
from perception.bayes.walls.evidence import LINE_MISFIT_MAX, SPAN_CHI2_MIN, SURE_SPAN_WEIGHT, WALL_MIN_M
from perception.bayes.walls.fit import fit_walls
from perception.bayes.walls.numbers import number_spans
from perception.bayes.walls.support import copy_near, support
from perception.kernel import kernel
from perception.records import Structured
from perception.shared_numbers import FAR

CANDIDATES_MAX: Final = 8
"""Lines that are scored for one echo."""
PAIR_MIN_M: Final = 0.25
"""Least distance between the sensors of a pair."""
PAIR_MAX_M: Final = 2.5
"""Greatest distance between the sensors of a pair."""
PAIR_MIN_COS: Final = 0.75
"""Least cosine between their axes."""
TANGENT_MAX_COS: Final = 0.9
"""Greatest difference of two ranges, as a share of the sensors' distance: beyond, a wall is seen end-on."""
EDGE_NORMAL_MIN_COS: Final = 0.8
"""Least cosine between the axis and the normal of a wall from two beam edges."""
NEW_WALL_ECHOES_MIN: Final = 6.0
"""Least score of a candidate, as of `perception.bayes.walls.support`, and least echoes of a new wall."""
NEW_WALL_CHI2_MIN: Final = 9.0
"""Least evidence of a new wall's span."""
NEW_WALL_PASSES_MAX: Final = 0.35
"""Greatest passes of a new wall's span, as a share of its weight."""
NEW_WALL_VARIANCE_M2: Final = 0.03**2
"""Variance of a candidate's offset before the first fit, m²."""
NEW_WALL_SLOPE_VARIANCE: Final = 0.04**2
"""Variance of a candidate's slope before the first fit."""
KNOWN_SIGMA_M: Final = 0.06
"""Readings that touch a candidate where it is known less well than this do not count: what lies there by chance would
turn it, by a long lever."""
REPLACED_WEIGHT_MAX: Final = 12.0
"""A wall of less weight gives way to a new one where there are too many."""


@kernel
def candidate(a: Reading, b: Reading, choice: int, p: SettingsRecord) -> tuple[bool, float, float, float]:
    """Return a line that explains two echoes: whether there is one, its normal, and its distance from the origin, m.

    Parameters
    ----------
    a, b, p
        The readings and the settings.
    choice : int
        0, 1: the common tangents; 2, 3: through the ends of the beams' left edges, and of the right ones.
    """
    dx = b.x - a.x
    dy = b.y - a.y
    base = math.sqrt(dx * dx + dy * dy)
    if choice < 2:
        cosine = (a.range_m - b.range_m) / base
        if abs(cosine) > TANGENT_MAX_COS:
            return False, 0.0, 0.0, 0.0
        sine = math.sqrt(1.0 - cosine * cosine) * (1.0 - 2.0 * choice)
        nx = (cosine * dx - sine * dy) / base
        ny = (cosine * dy + sine * dx) / base
        least = p[0].cos_half_angle
        is_seen = nx * a.axis_x + ny * a.axis_y >= least and nx * b.axis_x + ny * b.axis_y >= least
        return is_seen, nx, ny, nx * a.x + ny * a.y + a.range_m
    c = p[0].cos_half_angle
    s = p[0].sin_half_angle * (5.0 - 2.0 * choice)
    ax = a.x + a.range_m * (a.axis_x * c - a.axis_y * s)
    ay = a.y + a.range_m * (a.axis_y * c + a.axis_x * s)
    bx = b.x + b.range_m * (b.axis_x * c - b.axis_y * s)
    by = b.y + b.range_m * (b.axis_y * c + b.axis_x * s)
    length = math.hypot(bx - ax, by - ay)
    if length < PAIR_MIN_M:
        return False, 0.0, 0.0, 0.0
    nx = (ay - by) / length
    ny = (bx - ax) / length
    if nx * a.axis_x + ny * a.axis_y < 0.0:
        nx = -nx
        ny = -ny
    return nx * a.axis_x + ny * a.axis_y >= EDGE_NORMAL_MIN_COS, nx, ny, nx * ax + ny * ay


@kernel
def find_near(s: StateRecord, p: SettingsRecord, newest: int) -> int:
    """Copy the recent readings that may bear on a line through one of them to the scratch, and return their number.

    It is 0 if too few of them are echoes that nothing explains.

    Parameters
    ----------
    s, p
        Memory and settings; the scratch is updated.
    newest : int
        The place of the one.
    """
    room = s[0].room
    q = room.recent[newest].reading
    # A line's normal lies in both beams, or in the wider range in which edges of beams answer.
    least = 0.0 if edges_answer(room) else 2.0 * p[0].cos_half_angle ** 2 - 1.0
    n = 0
    free = 1
    for j in range(min(room.recent_count, RECENT_READINGS_MAX)):
        other = room.recent[j].reading
        if j != newest and other.axis_x * q.axis_x + other.axis_y * q.axis_y >= least:
            s[0].scratch.near_recent[n] = j
            copy_near(room.recent[j], s[0].scratch.near_readings, n)
            n += 1
            free += room.recent[j].is_free
    return n if free > NEW_WALL_ECHOES_MIN else 0


@kernel
def best_line(s: StateRecord, p: SettingsRecord, newest: int) -> bool:
    """Write the best line through a recent echo and another one to the candidate; return whether it is good enough.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    newest : int
        The echo's place among the recent readings.
    """
    room = s[0].room
    wall = room.walls[CANDIDATE]
    near = find_near(s, p, newest)
    q = room.recent[newest].reading
    wall.origin_x = q.x
    wall.origin_y = q.y
    wall.slope = 0.0
    choices = 4 if edges_answer(room) else 2
    best = NEW_WALL_ECHOES_MIN
    best_x = 0.0
    best_y = 0.0
    best_c = 0.0
    tried = 0
    for k in range(1, near + 1):
        other = room.recent[s[0].scratch.near_recent[int(k * GOLDEN_RATIO % 1.0 * near)]]
        base = math.hypot(other.reading.x - q.x, other.reading.y - q.y)
        if other.is_free != IS_FREE or not PAIR_MIN_M <= base <= PAIR_MAX_M:
            continue
        if other.reading.axis_x * q.axis_x + other.reading.axis_y * q.axis_y < PAIR_MIN_COS:
            continue
        for choice in range(choices):
            is_line, nx, ny, c = candidate(q, other.reading, choice, p)
            if is_line:
                tried += 1
                wall.normal_x = nx
                wall.normal_y = ny
                wall.offset = c - nx * q.x - ny * q.y
                score = support(room, s[0].scratch.near_readings, near, wall, base, p)
                if score > best:
                    best = score
                    best_x = nx
                    best_y = ny
                    best_c = wall.offset
        if tried >= CANDIDATES_MAX:
            break
    wall.normal_x = best_x
    wall.normal_y = best_y
    wall.offset = best_c
    wall.variance_offset = NEW_WALL_VARIANCE_M2
    wall.covariance = 0.0
    wall.variance_slope = NEW_WALL_SLOPE_VARIANCE
    return best > NEW_WALL_ECHOES_MIN


@kernel
def enter_recent(s: StateRecord, p: SettingsRecord) -> int:
    """Put the recent readings that bear on the candidate into its bins anew; return the number of echoes among them.

    Parameters
    ----------
    s, p
        Memory and settings; the echoes entered are marked as taken, and the frame turns onto the line.
    """
    room = s[0].room
    wall = room.walls[CANDIDATE]
    nx, ny = wall_normal(wall)
    length = math.sqrt(nx * nx + ny * ny)
    wall.normal_x = nx / length
    wall.normal_y = ny / length
    wall.slope = 0.0
    edges = edges_answer(room)
    nx, ny = wall.normal_x, wall.normal_y
    least = SLANTING_MIN_COS if edges else p[0].cos_half_angle
    echoes = 0
    clear_wall(wall)
    for j in range(min(room.recent_count, RECENT_READINGS_MAX)):
        recent = room.recent[j]
        if recent.is_free == IS_TAKEN:
            recent.is_free = IS_FREE
        q = recent.reading
        if nx * q.axis_x + ny * q.axis_y < least:  # most of them: they face elsewhere
            continue
        kind, expected, along, dot = contact(wall, q, p)
        if kind == NOWHERE or (edges and line_variance(wall, along) > KNOWN_SIGMA_M**2):
            continue
        e = q.range_m - expected
        slack = tolerance(room, wall, along, expected, dot)
        if abs(e) < slack:
            if recent.is_free == IS_FREE:
                recent.is_free = IS_TAKEN
                enter_reading(room, wall, q, kind, p)
                echoes += 1
        elif e > slack and kind == FOOT and dot >= p[0].cos_must_answer:
            b = bin_of(along)
            if 0 <= b < WALL_BINS:
                wall.bins[b].passes += 1.0 if q.range_m < FAR else SILENT_PASS
    return echoes


@kernel
def end_candidate(s: StateRecord, is_new: bool) -> None:
    """Free the candidate's place, and mark the echoes that it took: as known if it has become a wall.

    Parameters
    ----------
    s
        Memory, updated.
    is_new : bool
        Whether it has.
    """
    room = s[0].room
    room.walls[CANDIDATE].weight = 0.0
    for j in range(RECENT_READINGS_MAX):
        if room.recent[j].is_free == IS_TAKEN:
            room.recent[j].is_free = IS_KNOWN if is_new else IS_FREE


@kernel
def is_wall(s: StateRecord) -> bool:
    """Return whether the fitted candidate is a wall."""
    wall = s[0].room.walls[CANDIDATE]
    for k in range(wall.span_count):
        span = wall.spans[k]
        is_long = span.high - span.low >= WALL_MIN_M and span.weight >= SURE_SPAN_WEIGHT
        is_flat = max(span.chi2, wall.chi2) >= NEW_WALL_CHI2_MIN and span.chi2 > SPAN_CHI2_MIN
        if is_long and is_flat and span.passes < NEW_WALL_PASSES_MAX * span.weight:
            return bool(wall.misfit < LINE_MISFIT_MAX)
    return False


def fit_candidate(memory: Memory, p: SettingsRecord) -> bool:
    """Fit the candidate, whose line is known roughly, to the recent readings; return whether it is a wall."""
    for _ in range(FIT_ROUNDS):
        if enter_recent(memory.s, p) < NEW_WALL_ECHOES_MIN:
            return False
        fit_walls(memory.s, p, CANDIDATE, CANDIDATE + 1, 1)
    return is_wall(memory.s)


def try_wall(memory: Memory, p: SettingsRecord, newest: int) -> bool:
    """Look for a wall through a recent echo, and add it; return whether there is one.

    It replaces a light wall where there are too many.

    Parameters
    ----------
    memory, p
        Updated, and the settings.
    newest : int
        The echo's place among the recent readings.
    """
    if not best_line(memory.s, p, newest):
        return False
    is_new = fit_candidate(memory, p)
    if is_new:
        walls: Structured = memory.state["room"]["walls"][0]
        weight = walls["weight"][:MAX_WALLS]
        slot = int(np.argmin(weight))
        if weight[slot] < min(walls["weight"][CANDIDATE], REPLACED_WEIGHT_MAX):
            walls[slot] = walls[CANDIDATE]
            number_spans(memory.s, slot)
    end_candidate(memory.s, is_new)
    return is_new
