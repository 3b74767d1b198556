"""Where in its beam an echo came from, and how often each cell answers: expectation maximisation over cells.

A range does not say where on its arc the echo began. The map does: a cell's probability of answering, learnt from
all echoes that were shared to it and all ranges that passed through it, says how to share the next one, and earlier
ones are shared again as the map improves (Thrun, "Learning occupancy grid maps with forward sensor models",
Autonomous Robots 15, 2003, who fits a map of two values so). Cells count apart for each looking direction, so one
model serves mirrors and surfaces that answer at any angle.

A map's cells are the sums of what its readings have put there, in whole numbers: what one reading has put there can
be taken away to the bit, and all can be made again from the readings and their shares.
"""

from __future__ import annotations

import math
from typing import Final

from perception.kernel import kernel
from perception.mapping.surfaces.parameters import (
    ANSWER_MIN,
    CELL_M,
    CELLS,
    DIRECTIONS,
    NEARER_M,
    OWN_HITS_MIN,
    PRIOR_READINGS,
    REACH_M,
    SAMPLES,
    SHARE_BITS,
    SHARES_A_WORD,
    STRENGTH_SHARE,
    TAIL_CELLS,
    TAIL_SHARE,
    WHOLE,
    WHOLE_PASS,
)
from perception.mapping.surfaces.records import BLOCK, RIM, WORDS, CellCounts, KeptReading, LocalMap
from perception.records import Records
from perception.shared_numbers import LEAST_READINGS, OUTLIER, ROUNDING, SILENCE_M

BLUR: Final = 16.0
"""Sum of the weights 1, 2, 4 with which the hits of 3 × 3 cells are blurred."""
HITS: Final = 3.0 / (BLUR * WHOLE)
"""A surface of three cells' thickness gets whole echoes, which blurring divides among them."""
LEAST_HITS: Final = 0.03
"""Hits that every cell has without having been looked at: it answers with 6 %."""
AXIS_LOSS: Final = 0.5
"""At the beam's edge a pass counts half, less with the square of the angle. An echo is as likely from there as
from the middle: 42 to 67 % of the drives' echoes are from the outer third, as a slanting surface is nearest there."""
DIRECTION_RAD: Final = math.tau / DIRECTIONS
"""Angle between two looking directions."""
BORDER_COS: Final = math.cos(DIRECTION_RAD)
BORDER_SIN: Final = math.sin(DIRECTION_RAD)
CELLS_A_M: Final = 1.0 / CELL_M
"""To multiply is several times as fast as to divide."""


@kernel
def cell_of(offset: float) -> int:
    """Return the row or column of a place, its offset from the map's centre in m; −1 outside."""
    at = math.floor(offset * CELLS_A_M) + CELLS // 2
    return int(at) if RIM <= at < CELLS - RIM else -1


@kernel
def answer_probability(cells: CellCounts, i: int, j: int, b: int) -> float:
    """Return the probability that a cell answers to a direction.

    Parameters
    ----------
    cells : CellCounts
        The cells.
    i, j, b : int
        Row and column, not in the rim, and the direction.
    """
    hits, every = cells.hits, cells.all_hits
    beside = hits[b, i - 1, j] + hits[b, i + 1, j] + hits[b, i, j - 1] + hits[b, i, j + 1]
    across = hits[b, i - 1, j - 1] + hits[b, i - 1, j + 1] + hits[b, i + 1, j - 1] + hits[b, i + 1, j + 1]
    own = HITS * (4 * hits[b, i, j] + 2 * beside + across)
    beside = every[i - 1, j] + every[i + 1, j] + every[i, j - 1] + every[i, j + 1]
    across = every[i - 1, j - 1] + every[i - 1, j + 1] + every[i + 1, j - 1] + every[i + 1, j + 1]
    total = HITS * (4 * every[i, j] + 2 * beside + across)
    prior = (total + LEAST_HITS) / (total + cells.all_passes[i >> 1, j >> 1] / WHOLE_PASS + LEAST_READINGS)
    return float(
        (own + PRIOR_READINGS * prior) / (own + cells.passes[b, i >> 1, j >> 1] / WHOLE_PASS + PRIOR_READINGS)
    )


@kernel
def enter_passes(cells: CellCounts, q: KeptReading, half: float, sign: int) -> None:
    """Add what a range passed through, or take it away.

    Parameters
    ----------
    cells, q
        The cells, updated, and the reading.
    half : float
        Half of the beam's opening, rad, at most π/4.
    sign : int
        1 or −1.
    """
    x, y, axis = q.x, q.y, q.axis
    size, a_m = 2.0 * CELL_M, 0.5 * CELLS_A_M
    far = q.range_m - NEARER_M if q.range_m <= REACH_M else SILENCE_M
    if not size < far:
        return
    ux, uy = math.cos(axis), math.sin(axis)
    c, s = math.cos(half), math.sin(half)
    # The beam lies to the left of its right edge and to the right of its left edge.
    right_x, right_y, left_x, left_y = ux * c + uy * s, uy * c - ux * s, ux * c - uy * s, uy * c + ux * s
    low_x, high_x = min(0.0, far * right_x, far * left_x), max(0.0, far * right_x, far * left_x)
    if abs(uy) < s:  # the arc bulges along x
        low_x, high_x = (low_x, far) if ux > 0.0 else (-far, high_x)
    right_x, left_x = away_from_zero(right_x), away_from_zero(left_x)
    right, left = right_y / right_x, left_y / left_x
    # A beam of up to ±45° holds at most three borders between looking directions.
    first = math.floor((axis - half) / DIRECTION_RAD)
    borders = math.floor((axis + half) / DIRECTION_RAD) - first
    c1, s1 = math.cos((first + 1) * DIRECTION_RAD), math.sin((first + 1) * DIRECTION_RAD)
    c2, s2 = c1 * BORDER_COS - s1 * BORDER_SIN, s1 * BORDER_COS + c1 * BORDER_SIN
    c3, s3 = c2 * BORDER_COS - s2 * BORDER_SIN, s2 * BORDER_COS + c2 * BORDER_SIN
    ends = CELLS // 2
    begin_i = max(1, math.floor((x + low_x) * a_m) + ends // 2)
    end_i = min(ends - 1, math.floor((x + high_x) * a_m) + ends // 2 + 1)
    tangent = c / s
    for i in range(begin_i, end_i):
        dx = (i + 0.5 - 0.5 * ends) * size - x
        if dx * dx > far * far:
            continue
        # The middles of a row's cells in the beam lie between its edges and within its reach.
        high_y = math.sqrt(far * far - dx * dx)
        low_y = -high_y
        if right_x > 0.0:
            low_y = max(low_y, dx * right)
        else:
            high_y = min(high_y, dx * right)
        if left_x > 0.0:
            high_y = min(high_y, dx * left)
        else:
            low_y = max(low_y, dx * left)
        begin_j = max(1, math.ceil((y + low_y) * a_m - 0.5) + ends // 2)
        end_j = min(ends - 1, math.floor((y + high_y) * a_m - 0.5) + ends // 2 + 1)
        for j in range(begin_j, end_j):
            dy = (j + 0.5 - 0.5 * ends) * size - y
            along = dx * ux + dy * uy
            if along <= 0.0:  # the sensor's own place
                continue
            off = (dy * ux - dx * uy) / along * tangent
            b = first
            if borders > 0 and c1 * dy - s1 * dx > 0.0:
                b += 1
            if borders > 1 and c2 * dy - s2 * dx > 0.0:
                b += 1
            if borders > 2 and c3 * dy - s3 * dx > 0.0:
                b += 1
            weight = sign * int(WHOLE_PASS * (1.0 - AXIS_LOSS * off * off) + 0.5)
            cells.passes[b % DIRECTIONS, i, j] += weight
            cells.all_passes[i, j] += weight


@kernel
def away_from_zero(x: float) -> float:
    """Return a divisor: a number, or one of the same sign near it that is not so small."""
    if abs(x) >= ROUNDING:
        return x
    return ROUNDING if x >= 0.0 else -ROUNDING


@kernel
def off_axis(k: int) -> float:
    """Return how far the place k on an arc is from the beam's axis, as a share of half the opening: −1 to 1."""
    return (2.0 * k + 1.0) / SAMPLES - 1.0


@kernel
def lay_arc(cells: CellCounts, q: KeptReading, half: float) -> None:
    """Write the places on a reading's arc into `cells.arc`: offsets from the map's centre, cells and directions.

    Parameters
    ----------
    cells, q
        The cells, whose `arc` is overwritten, and the reading, an echo.
    half : float
        As for `enter_passes`.
    """
    step = 2.0 * half / SAMPLES
    first = q.axis + off_axis(0) * half
    turn_c, turn_s = math.cos(step), math.sin(step)
    c, s = math.cos(first), math.sin(first)
    turns = math.floor(first / DIRECTION_RAD)
    b, border = turns % DIRECTIONS, (turns + 1) * DIRECTION_RAD
    for k in range(SAMPLES):
        if first + k * step >= border:
            b, border = (b + 1) % DIRECTIONS, border + DIRECTION_RAD
        place = cells.arc[k]
        place.x, place.y = q.x + q.range_m * c, q.y + q.range_m * s
        c, s = turn_c * c - turn_s * s, turn_s * c + turn_c * s
        place.i, place.j = cell_of(place.x), cell_of(place.y)
        if place.j < 0:
            place.i = -1
        place.b = b


@kernel
def share_echo(cells: CellCounts, q: KeptReading) -> None:
    """Share an echo among the places on its arc, which was laid, each as the map says that it answers.

    Parameters
    ----------
    cells, q
        The cells without this echo, and the reading; its shares are overwritten. They sum up to less than a whole
        echo, as that may come from nowhere.
    """
    total = OUTLIER
    p = 0.0
    for k in range(SAMPLES):
        at = cells.arc[k]
        cells.likelihoods[k] = 0.0
        if at.i >= 0:
            before = cells.arc[max(k - 1, 0)]
            if k == 0 or at.i != before.i or at.j != before.j or at.b != before.b:
                p = answer_probability(cells, at.i, at.j, at.b)
            cells.likelihoods[k] = p
        total += cells.likelihoods[k]
    for w in range(WORDS):
        word = 0
        for k in range(SHARES_A_WORD):
            share = int(cells.likelihoods[w * SHARES_A_WORD + k] / total * WHOLE + 0.5)
            word |= share << (k * SHARE_BITS)
        q.shares[w] = word


@kernel
def share_of(q: KeptReading, k: int) -> int:
    """Return an echo's share of a place on its arc, in parts of `WHOLE`."""
    return int(q.shares[k // SHARES_A_WORD] >> (k % SHARES_A_WORD * SHARE_BITS)) & WHOLE


@kernel
def enter_hits(cells: CellCounts, q: KeptReading, sign: int) -> None:
    """Add an echo, whose arc was laid, to the cells by its shares (sign 1), or take it away (−1)."""
    for w in range(WORDS):
        word = q.shares[w]
        k = w * SHARES_A_WORD
        while word != 0:
            share = word & WHOLE
            at = cells.arc[k]
            if share != 0 and at.i >= 0:
                cells.hits[at.b, at.i, at.j] += sign * share
                cells.all_hits[at.i, at.j] += sign * share
                cells.block_hits[at.i // BLOCK, at.j // BLOCK] += sign * share
            word >>= SHARE_BITS
            k += 1


@kernel
def enter_readings(
    cells: CellCounts, readings: Records[KeptReading], begin: int, end: int, shared: int, half: float
) -> None:  # fmt: skip
    """Enter readings, and share their echoes.

    Parameters
    ----------
    cells, readings
        Updated.
    begin, end : int
        Which readings.
    shared : int
        So many of all readings keep the shares that they have.
    half : float
        As for `enter_passes`.
    """
    for k in range(begin, end):
        enter_passes(cells, readings[k], half, 1)
        if readings[k].range_m <= REACH_M:
            lay_arc(cells, readings[k], half)
            if k >= shared:
                share_echo(cells, readings[k])
            enter_hits(cells, readings[k], 1)


@kernel
def share_again(cells: CellCounts, readings: Records[KeptReading], begin: int, end: int, half: float) -> None:
    """Share echoes again that were entered before, by what the map says now; parameters as for `enter_readings`."""
    for k in range(begin, end):
        if readings[k].range_m <= REACH_M:
            lay_arc(cells, readings[k], half)
            enter_hits(cells, readings[k], -1)
            share_echo(cells, readings[k])
            enter_hits(cells, readings[k], 1)


@kernel
def make_again(rooms: Records[LocalMap], every: Records[CellCounts], half: float) -> None:
    """Enter the readings of a map that had been entered, whose shares are known, into empty cells."""
    enter_readings(every[0], rooms[0].readings, 0, rooms[0].entered, rooms[0].entered, half)


@kernel
def clear_cells(cells: CellCounts, begin: int, end: int) -> None:
    """Set what readings have put into some rows of blocks to 0: only where they have, which is a small part."""
    half = BLOCK // 2
    for bi in range(begin, end):
        for bj in range(CELLS // BLOCK):
            if cells.block_hits[bi, bj] != 0:
                cells.block_hits[bi, bj] = 0
                for i in range(bi * BLOCK, (bi + 1) * BLOCK):
                    cells.all_hits[i, bj * BLOCK : (bj + 1) * BLOCK] = 0
                    for b in range(DIRECTIONS):
                        cells.hits[b, i, bj * BLOCK : (bj + 1) * BLOCK] = 0
            for i in range(bi * half, (bi + 1) * half):
                if cells.all_passes[i, bj * half : (bj + 1) * half].any():
                    cells.all_passes[i, bj * half : (bj + 1) * half] = 0
                    for b in range(DIRECTIONS):
                        cells.passes[b, i, bj * half : (bj + 1) * half] = 0


@kernel
def hits_around(cells: CellCounts, b: int, i: int, j: int, reach: int) -> int:
    """Return the hits from a direction of the cells up to `reach` rows and columns from one, not in the rim."""
    hits = 0
    for row in range(i - reach, i + reach + 1):
        for column in range(j - reach, j + reach + 1):
            hits += cells.hits[b, row, column]
    return hits


@kernel
def direction_strength(hits: int) -> float:
    """Return how many echoes the hits from one direction are worth: they repeat one another."""
    return min(hits / WHOLE, 1.0) + STRENGTH_SHARE * hits / WHOLE


@kernel
def greatest_strength(cells: CellCounts, i: int, j: int) -> float:
    """Return what `strength_of` a cell cannot exceed; it is quick."""
    every, near = cells.all_hits, 0
    for di in range(-1, 2):
        near += every[i + di, j - 1] + every[i + di, j] + every[i + di, j + 1]
    return (1.0 + STRENGTH_SHARE) * near / WHOLE * math.sqrt(min(every[i, j] / WHOLE, 1.0))


@kernel
def strength_of(cells: CellCounts, i: int, j: int) -> float:
    """Return how many echoes speak for a cell, not in the rim.

    Echoes of one direction repeat one another, so each direction counts one at most and a small share of the rest.
    """
    own = cells.all_hits[i, j] / WHOLE
    if own <= OWN_HITS_MIN:
        return 0.0
    most = 0
    for row in range(max(0, i - TAIL_CELLS), min(CELLS, i + TAIL_CELLS + 1)):
        for column in range(max(0, j - TAIL_CELLS), min(CELLS, j + TAIL_CELLS + 1)):
            most = max(most, cells.all_hits[row, column])
    if cells.all_hits[i, j] < TAIL_SHARE * most:
        return 0.0
    strength = 0.0
    is_answering = False
    for b in range(DIRECTIONS):
        heard = hits_around(cells, b, i, j, 1)
        strength += direction_strength(heard)
        is_answering = is_answering or (heard > 0 and answer_probability(cells, i, j, b) > ANSWER_MIN)
    return strength * math.sqrt(min(own, 1.0)) if is_answering else 0.0


@kernel
def passes_of_heard(cells: CellCounts, b: int, i: int, j: int, hits: int) -> int:
    """Return how many ranges passed a cell in a direction that hears it, in parts of `WHOLE`.

    Parameters
    ----------
    cells : CellCounts
        The cells.
    b, i, j : int
        The direction, row and column.
    hits : int
        What that direction hears there, in parts of `WHOLE`: passes count less where it is less than an echo.
    """
    return int(cells.passes[b, i >> 1, j >> 1] * min(hits, WHOLE) // WHOLE_PASS)
