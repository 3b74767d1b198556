"""A map of a few metres of way: where echoes came from, and what ranges went past, by expectation maximisation.

A range does not say where on its arc the echo began; the other ranges do. Each echo is shared among the cells of its
arc in proportion to what the map says of them so far, and shared again as the map improves (Thrun, "Learning
occupancy grid maps with forward sensor models", Autonomous Robots 15, 2003). Such a map holds for as long as odometry
is good. It is coarser than `perception.mapping.surfaces`: it is compared with others thousands of times.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from perception.kernel import Floats, kernel
from perception.shared_numbers import LEAST_READINGS, OUTLIER, SILENCE_M

SUBMAP_CELL_M: Final = 0.1
"""Edge of a map's cell."""
SUBMAP_CELLS: Final = 140
"""A map is a square about the ring's place in the middle of its way: half of that way and a range of 5 m fit."""
HALF_CELLS: Final = SUBMAP_CELLS // 2
"""Cells from a map's middle to its edge."""
ECHO_MAX_M: Final = 4.9
"""Echoes from farther count as silence, whose cone is clear up to `SILENCE_M` only: mirrors are silent, too."""
SHARING_ROUNDS: Final = 6
"""Rounds of expectation maximisation."""
PASS_RAYS: Final = 21
"""Rays of a beam along which a range is entered as passed: 0.1 m apart at 5 m and ±12°."""
PRIOR_HITS: Final = 0.015
"""Hits of a cell that was not looked at: it answers with 3 %."""
THICKNESS: Final = 3.0
"""A surface is about three cells thick once it is blurred, which divide each echo among them."""
CHUNK: Final = 64
"""Readings whose passes are entered in one quantum."""


def make_grid(readings: Floats, half: float) -> Iterator[Floats]:
    """Make the map of hits and passes of readings (n, 4), as of `enter_passes`; yield it after each quantum.

    Yields
    ------
    (2, SUBMAP_CELLS, SUBMAP_CELLS) float
        The same array, complete at last.
    """
    count = len(readings)
    grid, shared = np.zeros((2, SUBMAP_CELLS, SUBMAP_CELLS)), np.empty((SUBMAP_CELLS, SUBMAP_CELLS))
    for begin in range(0, count, CHUNK):
        enter_passes(readings, begin, min(begin + CHUNK, count), half, grid[1])
        yield grid
    for _ in range(SHARING_ROUNDS):
        share_echoes(readings, count, half, grid[1], grid[0], shared)
        yield grid


@kernel
def enter_passes(readings: Floats, begin: int, end: int, half: float, passes: Floats) -> None:
    """Add what ranges passed.

    Parameters
    ----------
    readings : (n, 4) float
        Sensor's place x, y (m) and direction (rad) in the map's frame, and the range, m; infinite if silent.
    begin, end : int
        Those to be entered.
    half : float
        Half of the beam's opening, rad.
    passes : (SUBMAP_CELLS, SUBMAP_CELLS) float
        Updated: a range in the middle of the beam counts 1, one at its edge ½.
    """
    for k in range(begin, end):
        x, y, axis, range_m = readings[k]
        clear = range_m - SUBMAP_CELL_M if range_m <= ECHO_MAX_M else SILENCE_M
        for ray in range(PASS_RAYS):
            t = 2.0 * (ray + 0.5) / PASS_RAYS - 1.0
            c, s = math.cos(axis + t * half), math.sin(axis + t * half)
            for step in range(int(clear / SUBMAP_CELL_M)):
                along = (step + 0.5) * SUBMAP_CELL_M
                i = math.floor((x + along * c) / SUBMAP_CELL_M) + HALF_CELLS
                j = math.floor((y + along * s) / SUBMAP_CELL_M) + HALF_CELLS
                if 0 <= i < SUBMAP_CELLS and 0 <= j < SUBMAP_CELLS:
                    share = min(1.0, 2.0 * half * along / (PASS_RAYS * SUBMAP_CELL_M))
                    passes[i, j] += share * (1.0 - 0.5 * t * t)


@kernel
def share_echoes(readings: Floats, count: int, half: float, passes: Floats, hits: Floats, shared: Floats) -> None:
    """Do one round of expectation maximisation: share all echoes anew by what the map says.

    Parameters
    ----------
    readings : (n, 4) float
        As of `enter_passes`.
    count : int
        How many there are.
    half : float
        Half of the beam's opening, rad.
    passes : (SUBMAP_CELLS, SUBMAP_CELLS) float
        Of all readings.
    hits : (SUBMAP_CELLS, SUBMAP_CELLS) float
        Blurred over 3 × 3 cells: those of the round before, zero in the first one. Overwritten.
    shared : (SUBMAP_CELLS, SUBMAP_CELLS) float
        Overwritten.
    """
    shared[:] = 0.0
    for k in range(count):
        x, y, axis, range_m = readings[k]
        if range_m > ECHO_MAX_M:
            continue
        places = max(3, int(4.0 * half * range_m / SUBMAP_CELL_M) + 1)
        total = OUTLIER
        for enters in range(2):
            for place in range(places):
                t = 2.0 * (place + 0.5) / places - 1.0
                i = math.floor((x + range_m * math.cos(axis + t * half)) / SUBMAP_CELL_M) + HALF_CELLS
                j = math.floor((y + range_m * math.sin(axis + t * half)) / SUBMAP_CELL_M) + HALF_CELLS
                if 1 <= i < SUBMAP_CELLS - 1 and 1 <= j < SUBMAP_CELLS - 1:
                    weight = (1.0 - 0.5 * t * t) * _answer(hits[i, j], passes[i, j]) / places
                    if enters:
                        shared[i, j] += weight / total
                    else:
                        total += weight
    for i in range(1, SUBMAP_CELLS - 1):
        for j in range(1, SUBMAP_CELLS - 1):
            beside = shared[i - 1, j] + shared[i + 1, j] + shared[i, j - 1] + shared[i, j + 1]
            across = shared[i - 1, j - 1] + shared[i - 1, j + 1] + shared[i + 1, j - 1] + shared[i + 1, j + 1]
            hits[i, j] = (4.0 * shared[i, j] + 2.0 * beside + across) / 16.0


@kernel
def _answer(hits: float, passes: float) -> float:
    """Return the probability that a cell answers."""
    return (THICKNESS * hits + PRIOR_HITS) / (THICKNESS * hits + passes + LEAST_READINGS)


@kernel
def add_map(
    hits: Floats, passes: Floats, x: float, y: float, theta: float, to_hits: Floats, to_passes: Floats
) -> None:
    """Add a map to another one, in which it lies at a pose (m, rad); its cells are interpolated."""
    c, s = math.cos(theta) / SUBMAP_CELL_M, math.sin(theta) / SUBMAP_CELL_M
    for a in range(SUBMAP_CELLS):
        for b in range(SUBMAP_CELLS):
            dx, dy = (a - HALF_CELLS + 0.5) * SUBMAP_CELL_M - x, (b - HALF_CELLS + 0.5) * SUBMAP_CELL_M - y
            row, column = c * dx + s * dy + HALF_CELLS - 0.5, c * dy - s * dx + HALF_CELLS - 0.5
            i, j = math.floor(row), math.floor(column)
            if 0 <= i < SUBMAP_CELLS - 1 and 0 <= j < SUBMAP_CELLS - 1:
                u, v = row - i, column - j
                for down in range(2):
                    for right in range(2):
                        share = (u if down else 1.0 - u) * (v if right else 1.0 - v)
                        to_hits[a, b] += share * hits[i + down, j + right]
                        to_passes[a, b] += share * passes[i + down, j + right]


@kernel
def answers_of(hits: Floats, passes: Floats, answers: Floats, known: Floats) -> None:
    """Compute how each cell answers.

    Parameters
    ----------
    hits, passes : (SUBMAP_CELLS, SUBMAP_CELLS) float
        Of one map or several.
    answers : (SUBMAP_CELLS, SUBMAP_CELLS) float
        Overwritten: probability that a cell answers.
    known : (SUBMAP_CELLS, SUBMAP_CELLS) float
        Overwritten: 0 where no range came, near 1 where many did.
    """
    for i in range(SUBMAP_CELLS):
        for j in range(SUBMAP_CELLS):
            looks = THICKNESS * hits[i, j] + passes[i, j]
            answers[i, j] = _answer(hits[i, j], passes[i, j])
            known[i, j] = looks / (looks + 1.0)
