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
    OUTLIER,
    OWN_HITS_MIN,
    PRIOR_READINGS,
    REACH_M,
    SAMPLES,
    SHARE_BITS,
    SHARES_A_WORD,
    SILENCE_M,
    STRENGTH_SHARE,
    TAIL_CELLS,
    TAIL_SHARE,
    WHOLE,
    WHOLE_PASS,
)
from perception.mapping.surfaces.records import WORDS, CellCounts, KeptReading
from perception.records import Records

BLUR: Final = 16.0
"""Sum of the weights 1, 2, 4 with which the hits of 3 × 3 cells are blurred."""
HITS: Final = 3.0 / (BLUR * WHOLE)
"""A surface of three cells' thickness gets whole echoes, which blurring divides among them."""
LEAST_HITS: Final = 0.03
LEAST_READINGS: Final = 0.5
"""A cell that has not been looked at answers with 6 %."""
AXIS_LOSS: Final = 0.5
"""At the beam's edge an echo or a pass counts half, less with the square of the angle."""
DIRECTION_RAD: Final = 2.0 * math.pi / DIRECTIONS
RIM: Final = 2
"""Cells at the map's rim that are not used, so that each cell has neighbours."""


@kernel
def cell_of(offset: float) -> int:
    """Return the row or column of a place, its offset from the map's centre in m; −1 outside."""
    at = math.floor(offset / CELL_M) + CELLS // 2
    return int(at) if RIM <= at < CELLS - RIM else -1


@kernel
def direction_of(dx: float, dy: float) -> int:
    """Return the looking direction of a vector from the sensor to a cell."""
    turns = math.atan2(dy, dx) / DIRECTION_RAD
    return math.floor(turns) % DIRECTIONS


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
    own = 4.0 * hits[i, j, b] + 2.0 * (hits[i - 1, j, b] + hits[i + 1, j, b] + hits[i, j - 1, b] + hits[i, j + 1, b])
    own += hits[i - 1, j - 1, b] + hits[i - 1, j + 1, b] + hits[i + 1, j - 1, b] + hits[i + 1, j + 1, b]
    total = 4.0 * every[i, j] + 2.0 * (every[i - 1, j] + every[i + 1, j] + every[i, j - 1] + every[i, j + 1])
    total += every[i - 1, j - 1] + every[i - 1, j + 1] + every[i + 1, j - 1] + every[i + 1, j + 1]
    own *= HITS
    total *= HITS
    prior = (total + LEAST_HITS) / (total + cells.all_passes[i >> 1, j >> 1] / WHOLE_PASS + LEAST_READINGS)
    return float(
        (own + PRIOR_READINGS * prior) / (own + cells.passes[i >> 1, j >> 1, b] / WHOLE_PASS + PRIOR_READINGS)
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
    size = 2.0 * CELL_M
    far = q.range_m - NEARER_M if q.range_m <= REACH_M else SILENCE_M
    if not size < far:
        return
    ux, uy = math.cos(axis), math.sin(axis)
    low_x, high_x, low_y, high_y = x, x, y, y
    for k in range(-2, 3):
        px = x + far * math.cos(axis + 0.5 * k * half)
        py = y + far * math.sin(axis + 0.5 * k * half)
        low_x, high_x = min(low_x, px), max(high_x, px)
        low_y, high_y = min(low_y, py), max(high_y, py)
    # A beam of up to ±45° holds at most three borders between looking directions.
    first = math.floor((axis - half) / DIRECTION_RAD)
    borders = math.floor((axis + half) / DIRECTION_RAD) - first
    c1, s1 = math.cos((first + 1) * DIRECTION_RAD), math.sin((first + 1) * DIRECTION_RAD)
    c2, s2 = math.cos((first + 2) * DIRECTION_RAD), math.sin((first + 2) * DIRECTION_RAD)
    c3, s3 = math.cos((first + 3) * DIRECTION_RAD), math.sin((first + 3) * DIRECTION_RAD)
    ends = CELLS // 2
    begin_i, end_i = max(1, int(low_x / size + 0.5 * ends)), min(ends - 1, int(high_x / size + 0.5 * ends) + 1)
    begin_j, end_j = max(1, int(low_y / size + 0.5 * ends)), min(ends - 1, int(high_y / size + 0.5 * ends) + 1)
    tangent = 1.0 / math.tan(half)
    for i in range(begin_i, end_i):
        dx = (i + 0.5 - 0.5 * ends) * size - x
        for j in range(begin_j, end_j):
            dy = (j + 0.5 - 0.5 * ends) * size - y
            along = dx * ux + dy * uy
            if along <= 0.0 or dx * dx + dy * dy > far * far:
                continue
            off = (dy * ux - dx * uy) / along * tangent
            if off * off >= 1.0:
                continue
            b = first
            if borders > 0 and c1 * dy - s1 * dx > 0.0:
                b += 1
            if borders > 1 and c2 * dy - s2 * dx > 0.0:
                b += 1
            if borders > 2 and c3 * dy - s3 * dx > 0.0:
                b += 1
            weight = sign * int(WHOLE_PASS * (1.0 - AXIS_LOSS * off * off) + 0.5)
            cells.passes[i, j, b % DIRECTIONS] += weight
            cells.all_passes[i, j] += weight


@kernel
def off_axis(k: int) -> float:
    """Return how far the place k on an arc is from the beam's axis, as a share of half the opening: −1 to 1."""
    return (2.0 * k + 1.0) / SAMPLES - 1.0


@kernel
def place_on_arc(q: KeptReading, k: int, half: float) -> tuple[float, float]:
    """Return the place k on a reading's arc from the sensor, m."""
    angle = q.axis + off_axis(k) * half
    return q.range_m * math.cos(angle), q.range_m * math.sin(angle)


@kernel
def share_echo(cells: CellCounts, q: KeptReading, half: float) -> None:
    """Share an echo among the places on its arc, each as the map says that it answers.

    Parameters
    ----------
    cells, q
        The cells without this echo, and the reading; its shares are overwritten. They sum up to less than a whole
        echo, as that may come from nowhere.
    half : float
        As for `enter_passes`.
    """
    total = OUTLIER
    for k in range(SAMPLES):
        dx, dy = place_on_arc(q, k, half)
        i, j = cell_of(q.x + dx), cell_of(q.y + dy)
        cells.likelihoods[k] = 0.0
        if i >= 0 and j >= 0:
            p = answer_probability(cells, i, j, direction_of(dx, dy))
            cells.likelihoods[k] = p * (1.0 - AXIS_LOSS * off_axis(k) * off_axis(k))
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
def enter_hits(cells: CellCounts, q: KeptReading, half: float, sign: int) -> None:
    """Add an echo to the cells by its shares, or take it away; the parameters as for `enter_passes`."""
    for k in range(SAMPLES):
        share = sign * share_of(q, k)
        if share == 0:
            continue
        dx, dy = place_on_arc(q, k, half)
        i, j = cell_of(q.x + dx), cell_of(q.y + dy)
        if i >= 0 and j >= 0:
            cells.hits[i, j, direction_of(dx, dy)] += share
            cells.all_hits[i, j] += share


@kernel
def enter_readings(cells: CellCounts, readings: Records[KeptReading], begin: int, end: int, half: float) -> None:
    """Enter readings, and share their echoes.

    Parameters
    ----------
    cells, readings
        Updated.
    begin, end : int
        Which readings.
    half : float
        As for `enter_passes`.
    """
    for k in range(begin, end):
        enter_passes(cells, readings[k], half, 1)
        if readings[k].range_m <= REACH_M:
            share_echo(cells, readings[k], half)
            enter_hits(cells, readings[k], half, 1)


@kernel
def share_again(cells: CellCounts, readings: Records[KeptReading], begin: int, end: int, half: float) -> None:
    """Share echoes again that were entered before, by what the map says now; parameters as for `enter_readings`."""
    for k in range(begin, end):
        if readings[k].range_m <= REACH_M:
            enter_hits(cells, readings[k], half, -1)
            share_echo(cells, readings[k], half)
            enter_hits(cells, readings[k], half, 1)


@kernel
def make_again(cells: CellCounts, readings: Records[KeptReading], count: int, half: float) -> None:
    """Enter readings whose shares are known into empty cells; the parameters as for `enter_readings`."""
    for k in range(count):
        enter_passes(cells, readings[k], half, 1)
        if readings[k].range_m <= REACH_M:
            enter_hits(cells, readings[k], half, 1)


@kernel
def strength_of(cells: CellCounts, i: int, j: int) -> float:
    """Return how many echoes speak for a cell, not in the rim.

    Echoes of one direction repeat one another, so each direction counts one at most and a small share of the rest.
    """
    own = cells.all_hits[i, j] / WHOLE
    if own <= OWN_HITS_MIN:
        return 0.0
    most = 0
    for di in range(-TAIL_CELLS, TAIL_CELLS + 1):
        for dj in range(-TAIL_CELLS, TAIL_CELLS + 1):
            if 0 <= i + di < CELLS and 0 <= j + dj < CELLS:
                most = max(most, cells.all_hits[i + di, j + dj])
    if cells.all_hits[i, j] < TAIL_SHARE * most:
        return 0.0
    strength = 0.0
    is_answering = False
    for b in range(DIRECTIONS):
        heard = 0
        for di in range(-1, 2):
            for dj in range(-1, 2):
                heard += cells.hits[i + di, j + dj, b]
        strength += min(heard / WHOLE, 1.0) + STRENGTH_SHARE * heard / WHOLE
        is_answering = is_answering or (heard > 0 and answer_probability(cells, i, j, b) > ANSWER_MIN)
    return strength * math.sqrt(min(own, 1.0)) if is_answering else 0.0
