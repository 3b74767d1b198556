"""One quantum of a local map's work: to enter readings, share earlier echoes again, or search for surfaces.

Each is a single call into compiled code: to hand a map over and to decide would cost more than the work.
"""

from __future__ import annotations

import math
from typing import Final

from perception.kernel import Floats, kernel
from perception.mapping.surfaces.cells import clear_cells, enter_readings, share_again
from perception.mapping.surfaces.parameters import (
    CELLS,
    LAST_REVISITS,
    LEFT_M,
    LEFT_MAX_M,
    READINGS_MAX,
    REVISITS,
    SPACING_RAD,
)
from perception.mapping.surfaces.piece_fit import group_echoes, judge, place_echoes
from perception.mapping.surfaces.pieces import ROW_PARTS, capture, grow_all, order_cells
from perception.mapping.surfaces.polylines import chain_all, choose_nodes
from perception.mapping.surfaces.records import BLOCK, CellCounts, LocalMap
from perception.records import Records
from perception.shared_numbers import FAR, SPACING_M

ENTERED: Final = 16
"""Readings that one quantum enters, in a twentieth of a millisecond, as each of those below."""
SHARED: Final = 48
"""Readings that one quantum shares along their arcs."""
STRENGTHS: Final = 64
"""Strengths of cells that one quantum computes, in parts of rows."""
STEPS: Final = 600
"""Steps along lines that one quantum makes, of whole pieces."""
LOCATED: Final = 128
"""Readings that one quantum locates."""
JUDGED: Final = 64
"""Echoes by which one quantum judges whole pieces."""
ORDERED: Final = 1024
"""Cells that one quantum puts in order."""
CLEARED: Final = 2
"""Rows of blocks that one quantum clears."""
IDLE, CAPTURE, GROW, LOCATE, JUDGE, CHOOSE, CHAIN, CLEAR = range(8)
"""Steps of a search, in their order; the last clears the cells at the start of another map."""
SEARCH_READINGS_MIN: Final = 64
"""A search begins after so many new readings."""
SEARCH_SHARE: Final = 5
"""A search begins after so large a part of all readings as one in this."""


@kernel
def keep(rooms: Records[LocalMap], mounts: Floats, pose: Floats, ranges: Floats, range_max: float) -> None:
    """Append the readings of the sensors that have moved, while there is room.

    Parameters
    ----------
    rooms : (1,) record of LocalMap
        Updated; the first reading's ring is its centre.
    mounts : (n, 3) float
        x, y (m), direction (rad) of each sensor in the ring's frame.
    pose : (3,) float
        The ring's place (m) and direction (rad).
    ranges : (n,) float
        m; infinite for silence, NaN of a sensor that did not fire.
    range_max : float
        Ranges from this on are silence, m.
    """
    room = rooms[0]
    if room.count == 0:
        room.centre_x, room.centre_y = pose[0], pose[1]
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for k in range(len(ranges)):
        if not ranges[k] >= 0.0 or room.count >= READINGS_MAX:  # also true for NaN
            continue
        x = pose[0] + c * mounts[k, 0] - s * mounts[k, 1]
        y = pose[1] + s * mounts[k, 0] + c * mounts[k, 1]
        axis = pose[2] + mounts[k, 2]
        if room.is_kept[k] == 1:
            moved = math.hypot(x - room.kept_x[k], y - room.kept_y[k])
            turned = axis - room.kept_axis[k]
            if moved < SPACING_M and 2.0 * abs(math.sin(0.5 * turned)) < SPACING_RAD:
                continue
        room.is_kept[k] = 1
        room.kept_x[k], room.kept_y[k], room.kept_axis[k] = x, y, axis
        q = room.readings[room.count]
        q.x, q.y, q.axis = x - room.centre_x, y - room.centre_y, axis
        q.range_m = ranges[k] if ranges[k] < range_max else FAR
        q.submap = room.submap
        room.count += 1


@kernel
def search_is_due(rooms: Records[LocalMap]) -> bool:
    """Return whether enough was entered since the last search."""
    room = rooms[0]
    new = room.entered - room.swept
    return new > 0 and (room.is_left == 1 or new >= max(SEARCH_READINGS_MIN, room.entered / SEARCH_SHARE))


@kernel
def is_due(rooms: Records[LocalMap]) -> bool:
    """Return whether a quantum has anything to do."""
    room = rooms[0]
    return room.entered < room.count or room.owed > 0 or room.phase != IDLE or search_is_due(rooms)


@kernel
def leave(rooms: Records[LocalMap]) -> None:
    """Have all echoes shared again before the last search, by what the whole map says."""
    room = rooms[0]
    if room.is_left == 0:
        room.is_left = 1
        room.owed += LAST_REVISITS * room.count


@kernel
def has_left(rooms: Records[LocalMap], x: float, y: float) -> bool:
    """Return whether a robot at a place (m) needs another local map; before, this one is searched once more."""
    room = rooms[0]
    away = max(abs(x - room.centre_x), abs(y - room.centre_y))
    if room.count > 0 and (away > LEFT_M or room.count >= READINGS_MAX):
        leave(rooms)
    return room.is_left == 1 and (away > LEFT_MAX_M or not is_due(rooms))


@kernel
def do_quantum(rooms: Records[LocalMap], every: Records[CellCounts], half: float, radii: Floats) -> bool:
    """Do one quantum; return whether it ended a search.

    Parameters
    ----------
    rooms, every : (1,) record
        The map and its counts, updated.
    half : float
        Half of the beam's opening, rad.
    radii : (k,) float
        Radii of the models, m.
    """
    room, counts = rooms[0], every[0]
    at = room.at
    if room.phase == IDLE:
        enter_or_share(rooms, every, half)
    elif room.phase == CAPTURE:
        if advance(room, capture(room, counts, at, STRENGTHS), ROW_PARTS):
            order_cells(rooms, every)
    elif room.phase == GROW:
        if grow_all(room, counts, STEPS):
            room.phase, room.at = LOCATE, 0
    elif room.phase == LOCATE:
        place_echoes(room, counts, at, min(at + LOCATED, room.swept), half)
        if advance(room, LOCATED, room.swept):
            group_echoes(rooms, every)
    elif room.phase == JUDGE:
        judged, echoes = 0, 0.0
        while at + judged < room.piece_count and echoes < JUDGED:
            judge(room, counts, at + judged, radii)
            echoes += room.pieces[at + judged].echoes
            judged += 1
        advance(room, judged, room.piece_count)
    elif room.phase == CHOOSE:
        choose_nodes(room, counts, at, min(at + ORDERED, room.cell_count))
        advance(room, ORDERED, room.cell_count)
    elif room.phase == CLEAR:
        clear_cells(counts, at, min(at + CLEARED, CELLS // BLOCK))
        if advance(room, CLEARED, CELLS // BLOCK):
            room.phase = IDLE
    else:
        chain_all(room, counts, at, min(at + ORDERED, room.cell_count))
        if advance(room, ORDERED, room.cell_count):
            room.phase = IDLE
            return True
    return False


@kernel
def enter_or_share(rooms: Records[LocalMap], every: Records[CellCounts], half: float) -> None:
    """Enter readings, share earlier echoes again, or where neither is left begin a search."""
    room, counts = rooms[0], every[0]
    if room.entered < room.count:
        end = min(room.entered + ENTERED, room.count)
        enter_readings(counts, room.readings, room.entered, end, room.carried, half)
        room.owed += REVISITS * max(end - max(room.entered, room.carried), 0)
        room.entered = end
    elif room.owed > 0:
        begin = room.revisited if room.revisited < room.entered else 0
        end = min(begin + min(SHARED, room.owed), room.entered)
        share_again(counts, room.readings, begin, end, half)
        room.revisited = end
        room.owed = room.owed - (end - begin) if end > begin else 0
    else:
        end_search(rooms, every)
        room.swept, room.phase = room.entered, CAPTURE


@kernel
def advance(room: LocalMap, by: int, end: int) -> bool:
    """Go on in the present step, or to the next one; return whether the step has ended."""
    room.at += by
    if room.at < end:
        return False
    room.phase, room.at = room.phase + 1, 0
    return True


@kernel
def end_search(rooms: Records[LocalMap], every: Records[CellCounts]) -> None:
    """Forget what the last search has found: a keyframe holds nothing that is over."""
    room, counts = rooms[0], every[0]
    for k in range(room.cell_count):
        cell = room.cells[k]
        counts.index[cell.i, cell.j] = 0
        cell.i, cell.j, cell.strength, cell.owner = 0, 0, 0.0, 0
    for k in range(min(room.piece_count + 1, len(room.pieces))):  # and one that did not grow
        piece = room.pieces[k]
        piece.x, piece.y, piece.ux, piece.uy, piece.low, piece.high = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        piece.echoes, piece.variance_across, piece.variance_turn, piece.evidence = 0.0, 0.0, 0.0, 0.0
    for k in range(room.swept):
        point = room.points[k]
        point.x, point.y, point.piece = 0.0, 0.0, 0
    room.chains[: room.chained] = 0
    room.phase, room.at, room.cell_count, room.piece_count, room.chained = IDLE, 0, 0, 0, 0
    room.heard, room.passed = 0.0, 0.0
