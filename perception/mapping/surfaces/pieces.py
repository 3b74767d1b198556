"""Straight pieces in the occupied cells: each begins at the strongest free cell and grows along its best line."""

from __future__ import annotations

import math
from typing import Final

from perception.kernel import Floats, Ints, kernel, loop_kernel
from perception.mapping.surfaces.cells import (
    CELLS_A_M,
    cell_of,
    greatest_strength,
    hits_around,
    passes_of_heard,
    strength_of,
)
from perception.mapping.surfaces.parameters import (
    CELL_M,
    CELLS,
    COVERED_MIN,
    DIRECTIONS,
    END_STRENGTH,
    GAP_M,
    NODE_CELLS,
    OFF_LINE_M,
    PIECE_MIN_M,
    STRENGTH_MIN,
    SURFACE_CELLS_MAX,
    WEAK_MIN,
    WHOLE,
)
from perception.mapping.surfaces.records import (
    ANGLES,
    BLOCK,
    DIGITS,
    FREE,
    RIM,
    CellCounts,
    LocalMap,
    Piece,
    SurfaceCell,
)
from perception.records import Records
from perception.shared_numbers import ROUNDING

ROW_PARTS: Final = CELLS * CELLS // BLOCK
"""Parts of rows, as long as a block."""
SEED_CELLS: Final = 10
"""Cells around a seed among which its direction is sought: half a metre."""
STRENGTH_STEPS: Final = 256.0
"""Steps of a cell's strength for each whole echo, in which cells are put in order."""
STRONG: Final = 4.0
"""Greatest strength of a cell as a weight."""
TAKEN_WEIGHT: Final = 0.3
"""Weight of the cells of other pieces in that search: lines cross."""
REACHES_M: Final = (0.5, 1.0, 2.0, 6.0, 13.0, 13.0)
"""How far a line is followed in each round of fitting; the last one is not fitted again."""
FREE_SHARE_MIN: Final = 0.25
"""A line whose cells are nearly all taken is not followed on. Drives: the same pieces in two thirds of the time."""
DIRECTION_STEPS: Final = 60
"""Steps along a line that take as long as to find a direction."""
STEP_M: Final = 0.7 * CELL_M
"""Step along a line in which cells are looked for: less than a cell, so that none is left out."""
OFFSETS: Final = 2
"""Steps to each side of the line in which cells are looked for."""


@kernel
def offset_of(at: int) -> float:
    """Return the place of a row's or column's middle from the map's centre, m."""
    return (at + 0.5 - 0.5 * CELLS) * CELL_M


@kernel
def capture(room: LocalMap, counts: CellCounts, begin: int, most: int) -> int:
    """Append occupied cells to the map's, row by row; return how many parts of rows were looked at.

    Cells that find no room are left out; weak ones leave the last quarter of it to the others. The places of cells in
    `counts.index` are written; it was 0 everywhere.

    Parameters
    ----------
    room, counts
        The map, updated, and its counts.
    begin, most : int
        The first of the `ROW_PARTS`, and after how many cells whose strength was computed the last one follows.
    """
    at, computed = begin, 0
    while at < ROW_PARTS and computed < most:
        i, j = at // (CELLS // BLOCK), at % (CELLS // BLOCK) * BLOCK
        at += 1
        if counts.block_hits[i // BLOCK, j // BLOCK] == 0 or not RIM <= i < CELLS - RIM:
            continue
        for column in range(max(j, RIM), min(j + BLOCK, CELLS - RIM)):
            least = WEAK_MIN if 4 * room.cell_count < 3 * SURFACE_CELLS_MAX else STRENGTH_MIN
            if greatest_strength(counts, i, column) <= least or room.cell_count >= SURFACE_CELLS_MAX:
                continue
            computed += 1
            strength = strength_of(counts, i, column)
            if strength > least:
                cell = room.cells[room.cell_count]
                cell.i, cell.j, cell.strength, cell.owner = i, column, strength, FREE
                room.cell_count += 1
                counts.index[i, column] = room.cell_count
    return at - begin


@kernel
def order_cells(rooms: Records[LocalMap], every: Records[CellCounts]) -> None:
    """Write the order of the occupied cells, the strongest first; equal ones stay in the order of their rows.

    Strengths count in whole steps of 1 / `STRENGTH_STEPS`, a number of two digits: the order by the lower one, then
    by the upper one (radix sort).
    """
    room, counts = rooms[0], every[0]
    for k in range(room.cell_count):
        counts.order[k] = k
    sort_by_digit(room, counts.order, counts.unsorted, counts.digits, 1)
    sort_by_digit(room, counts.unsorted, counts.order, counts.digits, DIGITS)


@kernel
def sort_by_digit(room: LocalMap, source: Ints, target: Ints, begins: Ints, unit: int) -> None:
    """Write the numbers of cells into `target`, those with a greater digit first, else as in `source`.

    Parameters
    ----------
    room : LocalMap
        The cells.
    source, target : (n,) int
        Their numbers; the second is overwritten.
    begins : (DIGITS + 1,) int
        Overwritten.
    unit : int
        The digit's place: 1 or `DIGITS`.
    """
    begins[:] = 0
    for k in range(room.cell_count):
        begins[rank_of(room.cells[source[k]].strength, unit) + 1] += 1
    for digit in range(DIGITS):
        begins[digit + 1] += begins[digit]
    for k in range(room.cell_count):
        rank = rank_of(room.cells[source[k]].strength, unit)
        target[begins[rank]] = source[k]
        begins[rank] += 1


@kernel
def rank_of(strength: float, unit: int) -> int:
    """Return 0 for the greatest value of a digit of a strength, and `DIGITS` − 1 for 0."""
    steps = int(min(strength * STRENGTH_STEPS, DIGITS * DIGITS - 1.0))
    return DIGITS - 1 - steps // unit % DIGITS


@kernel
def walk(
    cells: Records[SurfaceCell], counts: CellCounts, line: Piece, begin: float, reach: float
) -> None:  # fmt: skip
    """Follow a line through occupied cells to both sides, as far as no gap is too wide, and sum them.

    `counts.sums` is overwritten: weight, its sums of x, y, xx, xy, yy about the line's point, cells, cells without an
    owner, the ends, the share of the steps that met a cell, and 1 if the reach has ended it.

    Parameters
    ----------
    cells, counts
        The occupied cells; their index, and the marks of walks, which are updated.
    line : Piece
        The line.
    begin, reach : float
        Where on the line to begin, and how far from there to go, m.
    """
    sums = counts.sums
    sums[:] = 0.0
    counts.walks += 1
    ux, uy = line.ux, line.uy
    low, high = begin, begin
    steps, met_steps = 0, 0
    # The line in cells, from the map's corner.
    row, column = line.x * CELLS_A_M + CELLS // 2, line.y * CELLS_A_M + CELLS // 2
    rows, columns = ux * CELLS_A_M, uy * CELLS_A_M
    for side in range(2):
        way = 1.0 - 2.0 * side
        t, last, since = 0.0, 0.0, 0
        while t <= reach and t - last <= GAP_M + STEP_M:
            is_met = False
            along = begin + way * t
            for k in range(-OFFSETS, OFFSETS + 1):
                off = k * OFF_LINE_M / OFFSETS
                x, y = row + along * rows - off * columns, column + along * columns + off * rows
                if not (RIM <= x < CELLS - RIM and RIM <= y < CELLS - RIM):
                    continue
                i, j = int(x), int(y)
                n = counts.index[i, j] - 1
                if n < 0 or cells[n].strength <= STRENGTH_MIN:
                    continue
                dx, dy = offset_of(i) - line.x, offset_of(j) - line.y
                if abs(dy * ux - dx * uy) > OFF_LINE_M:
                    continue
                is_met = True
                if counts.marks[n] == counts.walks:
                    continue
                counts.marks[n] = counts.walks
                w = min(cells[n].strength, STRONG)
                sums[0] += w
                sums[1] += w * dx
                sums[2] += w * dy
                sums[3] += w * dx * dx
                sums[4] += w * dx * dy
                sums[5] += w * dy * dy
                sums[6] += 1.0
                if cells[n].owner == FREE:
                    sums[7] += 1.0
                end = dx * ux + dy * uy
                low, high = min(low, end), max(high, end)
            since += 1
            counts.steps += 1
            if is_met:
                last = t
                met_steps += 1
                steps += since
                since = 0
            t += STEP_M
        if t > reach:
            sums[11] = 1.0
    sums[8], sums[9] = low, high
    sums[10] = met_steps / max(steps, 1)


@loop_kernel
def add_cell(scores: Floats, ux: Floats, uy: Floats, i: float, j: float, weight: float) -> None:
    """Add a cell's weight to the directions of the lines through a seed that are near it.

    Parameters
    ----------
    scores : (ANGLES,) float
        Updated.
    ux, uy : (ANGLES,) float
        The directions, in widths of a line by cell.
    i, j : float
        The cell's place from the seed, cells.
    weight : float
        Where a line meets its middle.
    """
    for a in range(ANGLES):
        off = j * ux[a] - i * uy[a]
        near = 1.0 - off * off
        scores[a] += weight * (near if near > 0.0 else 0.0)


@kernel
def best_direction(cells: Records[SurfaceCell], counts: CellCounts, seed: int) -> float:
    """Return the direction of the line through a cell that meets most of the cells around it, rad."""
    i0, j0 = cells[seed].i, cells[seed].j
    count = 0
    for i in range(max(0, i0 - SEED_CELLS), min(CELLS, i0 + SEED_CELLS + 1)):
        for j in range(max(0, j0 - SEED_CELLS), min(CELLS, j0 + SEED_CELLS + 1)):
            n = counts.index[i, j] - 1
            if n >= 0 and cells[n].strength > STRENGTH_MIN:
                counts.near[count] = n
                count += 1
    scores = counts.scores
    scores[:] = 0.0
    for a in range(ANGLES):
        angle = math.pi * a / ANGLES
        counts.ux[a], counts.uy[a] = math.cos(angle) * CELL_M / OFF_LINE_M, math.sin(angle) * CELL_M / OFF_LINE_M
    for k in range(count):
        cell = cells[counts.near[k]]
        weight = min(cell.strength, STRONG) * (1.0 if cell.owner == FREE else TAKEN_WEIGHT)
        add_cell(scores, counts.ux, counts.uy, cell.i - i0, cell.j - j0, weight)
    best = 0
    for a in range(1, ANGLES):
        if scores[a] > scores[best]:
            best = a
    return math.pi * best / ANGLES


@kernel
def grow(room: LocalMap, counts: CellCounts, seed: int) -> bool:
    """Grow a straight piece from a cell, the map's last; return whether there is one, then it owns its cells."""
    cells, sums = room.cells, counts.sums
    angle = best_direction(cells, counts, seed)
    seed_x, seed_y = offset_of(cells[seed].i), offset_of(cells[seed].j)
    number = room.piece_count
    piece = room.pieces[number]
    piece.x, piece.y, piece.ux, piece.uy = seed_x, seed_y, math.cos(angle), math.sin(angle)
    for k in range(len(REACHES_M)):
        begin = (seed_x - piece.x) * piece.ux + (seed_y - piece.y) * piece.uy
        walk(cells, counts, piece, begin, REACHES_M[k])
        if sums[6] < 3.0 or sums[7] < FREE_SHARE_MIN * sums[6]:
            return False
        if k < len(REACHES_M) - 1:
            mx, my = sums[1] / sums[0], sums[2] / sums[0]
            xx, xy, yy = sums[3] / sums[0] - mx * mx, sums[4] / sums[0] - mx * my, sums[5] / sums[0] - my * my
            turn = 0.5 * math.atan2(2.0 * xy, xx - yy)
            ux, uy = math.cos(turn), math.sin(turn)
            moved = max(abs(mx), abs(my), abs(ux * piece.uy - uy * piece.ux))
            piece.x, piece.y, piece.ux, piece.uy = piece.x + mx, piece.y + my, ux, uy
            if moved < ROUNDING and sums[11] == 0.0:  # the same cells would be met again
                break
    piece.low, piece.high = sums[8] - 0.5 * CELL_M, sums[9] + 0.5 * CELL_M
    is_long = piece.high - piece.low >= PIECE_MIN_M
    if not is_long or sums[10] < COVERED_MIN or sums[7] < 0.5 * sums[6]:
        return False
    take(room, counts, number)
    room.piece_count += 1
    return True


@kernel
def take(room: LocalMap, counts: CellCounts, number: int) -> None:
    """Give a piece the free cells along it, and end it at its outermost strong ones."""
    piece = room.pieces[number]
    steps = int((piece.high - piece.low) / STEP_M) + 1
    low, high = piece.high, piece.low
    for step in range(steps + 1):
        along = piece.low + step * STEP_M
        for k in range(-OFFSETS, OFFSETS + 1):
            off = k * OFF_LINE_M / OFFSETS
            i = cell_of(piece.x + along * piece.ux - off * piece.uy)
            j = cell_of(piece.y + along * piece.uy + off * piece.ux)
            if i < 0 or j < 0 or counts.index[i, j] == 0:
                continue
            cell = room.cells[counts.index[i, j] - 1]
            if cell.owner == FREE:
                cell.owner = number
                count_answers(room, counts, i, j)
            if cell.strength > END_STRENGTH:
                t = (offset_of(i) - piece.x) * piece.ux + (offset_of(j) - piece.y) * piece.uy
                low, high = min(low, t - 0.5 * CELL_M), max(high, t + 0.5 * CELL_M)
    piece.low, piece.high = max(low, piece.low), min(high, piece.high)


@kernel
def count_answers(room: LocalMap, counts: CellCounts, i: int, j: int) -> None:
    """Add a piece's cell to what says how often the surfaces of this map answer to a direction that hears them."""
    for b in range(DIRECTIONS):
        hits = hits_around(counts, b, i, j, NODE_CELLS)
        room.heard += hits / WHOLE
        room.passed += passes_of_heard(counts, b, i, j, hits) / WHOLE


@kernel
def grow_all(room: LocalMap, counts: CellCounts, most: int) -> bool:
    """Grow pieces from the strongest free cells; return whether all were tried.

    Parameters
    ----------
    room, counts
        The map, updated: `room.at` is the next cell in order.
    most : int
        Steps along lines, after which no other cell is tried; to find a cell's direction counts as `DIRECTION_STEPS`.
    """
    counts.steps = 0
    while room.at < room.cell_count and room.piece_count < len(room.pieces):
        if counts.steps >= most:
            return False
        seed = counts.order[room.at]
        room.at += 1
        if room.cells[seed].owner == FREE and room.cells[seed].strength > STRENGTH_MIN:
            counts.steps += DIRECTION_STEPS
            grow(room, counts, seed)
    return True
