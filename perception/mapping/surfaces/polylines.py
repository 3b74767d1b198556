"""Polylines through the occupied cells for which no straight piece stands: what is not straight, or too short."""

from __future__ import annotations

import math
from typing import Final

from perception.kernel import kernel
from perception.mapping.surfaces.cells import direction_strength, hits_around, passes_of_heard
from perception.mapping.surfaces.parameters import (
    CELL_M,
    CELLS,
    DIRECTIONS,
    LINK_M,
    NODE_CELLS,
    NODE_M,
    NODE_STRENGTH,
    PIECE_KEPT_M,
    POINT_ECHO_NAT,
)
from perception.mapping.surfaces.pieces import offset_of
from perception.mapping.surfaces.records import CHAIN_MAX, FREE, NODE, CellCounts, LocalMap, SurfaceCell
from perception.shared_numbers import LEAST_READINGS

APART: Final = round(NODE_M / CELL_M)
LINKED: Final = round(LINK_M / CELL_M)
"""Cells between two points of a polyline, at least and at most."""


@kernel
def choose_nodes(room: LocalMap, counts: CellCounts, begin: int, end: int) -> None:
    """Make the strongest cells that are left, at least `NODE_M` apart, points of polylines, where echoes agree.

    Parameters
    ----------
    room, counts
        The map, updated, and its counts.
    begin, end : int
        Which cells, in order of their strength.
    """
    nat = pass_nat(room)
    for at in range(begin, end):
        cell = room.cells[counts.order[at]]
        if not is_unclaimed(room, cell):
            continue
        is_apart = True
        for i in range(max(0, cell.i - APART), min(CELLS, cell.i + APART + 1)):
            for j in range(max(0, cell.j - APART), min(CELLS, cell.j + APART + 1)):
                n = counts.index[i, j] - 1
                is_near = (i - cell.i) ** 2 + (j - cell.j) ** 2 < APART * APART
                if n >= 0 and is_near and room.cells[n].owner == NODE:
                    is_apart = False
        if is_apart and is_agreed(counts, cell, nat):
            cell.owner = NODE


@kernel
def is_unclaimed(room: LocalMap, cell: SurfaceCell) -> bool:
    """Return whether no straight piece stands for a cell, so that it may be a point of a polyline.

    The piece that took it may be too short to be kept, or end before the cell. A point of a polyline is claimed.
    """
    if cell.owner < 0:
        return bool(cell.owner == FREE)
    piece = room.pieces[cell.owner]
    if piece.high - piece.low < PIECE_KEPT_M:
        return True
    along = (offset_of(cell.i) - piece.x) * piece.ux + (offset_of(cell.j) - piece.y) * piece.uy
    return bool(along < piece.low - CELL_M or along > piece.high + CELL_M)


@kernel
def pass_nat(room: LocalMap) -> float:
    """Return the log odds of a surface after a range passed it, nat: what answers as the pieces of this map do.

    Pieces that answer at any angle are hardly ever passed, mirrors mostly.
    """
    passed = room.passed + LEAST_READINGS
    return math.log(passed / (room.heard + passed))


@kernel
def is_agreed(counts: CellCounts, cell: SurfaceCell, nat: float) -> bool:
    """Return whether two directions' echoes agree on a cell and those around it: strays come one by one.

    Ranges that passed it in these directions must not say more than the echoes do.

    Parameters
    ----------
    counts, cell
        The map's counts, and the cell.
    nat : float
        From `pass_nat`.
    """
    strength, passes = 0.0, 0.0
    for b in range(DIRECTIONS):
        hits = hits_around(counts, b, cell.i, cell.j, NODE_CELLS)
        strength += direction_strength(hits)
        passes += direction_strength(passes_of_heard(counts, b, cell.i, cell.j, hits))
    return bool(strength >= NODE_STRENGTH and strength * POINT_ECHO_NAT + passes * nat > 0.0)


@kernel
def next_node(room: LocalMap, counts: CellCounts, of: int) -> int:
    """Return the nearest point of a polyline that is linked to a cell and not taken, −1 if there is none."""
    cell = room.cells[of]
    best, nearest = LINKED * LINKED + 1, -1
    for i in range(max(0, cell.i - LINKED), min(CELLS, cell.i + LINKED + 1)):
        for j in range(max(0, cell.j - LINKED), min(CELLS, cell.j + LINKED + 1)):
            n = counts.index[i, j] - 1
            if n < 0 or n == of or room.cells[n].owner != NODE:
                continue
            away = (i - cell.i) ** 2 + (j - cell.j) ** 2
            if away < best:
                best, nearest = away, n
    return nearest


@kernel
def chain(room: LocalMap, counts: CellCounts, begin: int) -> int:
    """Follow a polyline from one of its points to both ends; return how many points it has.

    `counts.chain` gets the numbers of its cells, in order, which become free again.
    """
    count = 1
    counts.chain[0] = begin
    room.cells[begin].owner = FREE
    for side in range(2):
        of = begin
        while count < len(counts.chain):
            following = next_node(room, counts, of)
            if following < 0:
                break
            room.cells[following].owner = FREE
            if side == 0:
                counts.chain[count] = following
            else:
                for k in range(count, 0, -1):
                    counts.chain[k] = counts.chain[k - 1]
                counts.chain[0] = following
            count += 1
            of = following
    return count


@kernel
def chain_all(room: LocalMap, counts: CellCounts, begin: int, end: int) -> None:
    """Append the polylines that begin at some cells to the map's; the parameters as for `choose_nodes`."""
    for at in range(begin, end):
        if room.cells[counts.order[at]].owner != NODE or room.chained + CHAIN_MAX + 1 > len(room.chains):
            continue
        count = chain(room, counts, counts.order[at])
        for k in range(count):
            room.chains[room.chained + k] = counts.chain[k] + 1
        room.chains[room.chained + count] = 0
        room.chained += count + 1
