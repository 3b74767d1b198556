"""Straight walls of a map of a few metres of way.

A line is found by votes (Hough; Tardós, Neira, Newman, Leonard, "Robust mapping and localization in indoor
environments using sonar data", IJRR 21(4), 2002): a range says for each direction of its normal how far it lies, as
the echo came from the wall's nearest point in the beam. A rough wall answers each beam that meets it, a mirror those
square to it; a line through which many ranges pass is none.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from perception.angles import wrapped
from perception.kernel import Floats, kernel
from perception.localization.submaps.local_grid import ECHO_MAX_M, HALF_CELLS, SUBMAP_CELL_M
from perception.shared_numbers import ROUNDING

NORMALS: Final = 120
"""Directions of a normal that are voted for."""
NORMAL_STEP_RAD: Final = 2.0 * math.pi / NORMALS
DISTANCE_STEP_M: Final = 0.06
"""Step of the distances that are voted for, m."""
DISTANCES: Final = 2 * int(HALF_CELLS * SUBMAP_CELL_M / DISTANCE_STEP_M)
GRAZING_RAD: Final = math.radians(76.0)
"""Angle between a beam's axis and a wall's normal beyond which the wall is not heard. Rings have sensors each 15°."""
ON_LINE_M: Final = 0.08
"""An echo this near to a line may come from it."""
LINE_ECHOES_MIN: Final = 16
"""Echoes of a line."""
AT_EDGE: Final = 0.5
"""Vote of an echo from the edge of its beam: lines of all directions beyond may explain it."""
LINE_MIN_M: Final = 1.0
"""Length of a line."""
BENT_MAX_M: Final = 0.035
"""Root mean square of the distances of a line's echoes. Of echoes that lie there by chance it is 0.046 m."""
BENT_MIN_M: Final = 0.008
"""No wall is known to be straighter."""
ANSWERS_MIN: Final = 0.8
"""Share of the readings at a line that come from there, and do not pass through it. In ten drives with exact poses
9 % of the pairs of lines are wrong (3 σ) without this rule, 5 % with 0.6, 4 % with 0.8."""
LINES_MAX: Final = 5
"""Lines of a map."""
LINE_FIELDS: Final = 5
"""Direction of the normal (rad), distance along it (m), both ends along the line (m), its `BENT_MAX_M`."""
LINE_ROUNDS: Final = 8
"""Steps to the line that fits best."""
VOTERS: Final = 256
"""Readings that vote in one quantum."""
FITS: Final = 2.0
"""In `taken`, of echoes of the line that is fitted."""
NO_LINE, FOUND, DONE = range(3)
"""Results of a search."""


@kernel
def vote(readings: Floats, begin: int, end: int, half: float, taken: Floats, votes: Floats) -> None:
    """Count the echoes that each line may explain.

    Parameters
    ----------
    readings, begin, end, half
        As of `local_grid.enter_passes`.
    taken : (n,) float
        Not zero for readings that are explained already.
    votes : (NORMALS, DISTANCES) float
        Updated.
    """
    wide = int(GRAZING_RAD / NORMAL_STEP_RAD) + 1
    for k in range(begin, end):
        x, y, axis, range_m = readings[k]
        if taken[k] != 0.0 or range_m > ECHO_MAX_M:
            continue
        middle = round(axis / NORMAL_STEP_RAD)
        for number in range(middle - wide, middle + wide + 1):
            direction = number * NORMAL_STEP_RAD
            if abs(direction - axis) > GRAZING_RAD:
                continue
            beside = max(0.0, abs(direction - axis) - half - ROUNDING)
            distance = math.cos(direction) * x + math.sin(direction) * y + range_m * math.cos(beside)
            j = math.floor(distance / DISTANCE_STEP_M) + DISTANCES // 2
            if 0 <= j < DISTANCES:
                votes[number % NORMALS, j] += 1.0 if beside == 0.0 else AT_EDGE


@kernel
def fit_line(readings: Floats, count: int, half: float, taken: Floats, votes: Floats, line: Floats) -> int:
    """Fit the line with most votes to its echoes, which are then taken; return `NO_LINE`, `FOUND` or `DONE`.

    Parameters
    ----------
    readings, half, votes
        As of `vote`.
    count : int
        How many readings there are.
    taken : (n,) float
        Updated.
    line : (LINE_FIELDS,) float
        Overwritten.
    """
    if _most_votes(votes, line) < AT_EDGE * LINE_ECHOES_MIN:
        return DONE
    normal, distance = line[0], line[1]
    number = _fit(readings, count, half, taken, line)
    for k in range(count):
        if taken[k] == FITS:
            taken[k] = 1.0 if number > 0 else 0.0
    if number == 0:  # its voters lead elsewhere
        _take_near(readings, count, half, normal, distance, taken)
        return NO_LINE
    if line[3] - line[2] < LINE_MIN_M or line[4] > BENT_MAX_M or _answered(readings, count, half, line) < ANSWERS_MIN:
        return NO_LINE
    line[0], line[4] = wrapped(line[0]), max(BENT_MIN_M, line[4])
    return FOUND


@kernel
def _most_votes(votes: Floats, line: Floats) -> float:
    """Enter direction and distance with most votes; return how many they are."""
    most = 0.0
    for i in range(NORMALS):
        for j in range(1, DISTANCES - 1):
            near = votes[i, j] + 0.5 * (votes[i, j - 1] + votes[i, j + 1])
            if near > most:
                most = near
                line[0], line[1] = i * NORMAL_STEP_RAD, (j + 0.5 - DISTANCES // 2) * DISTANCE_STEP_M
    return most


@kernel
def _fit(readings: Floats, count: int, half: float, taken: Floats, line: Floats) -> int:
    """Fit a line to the echoes near it, which are then `FITS` in `taken`; return how many, 0 for too few."""
    for _ in range(LINE_ROUNDS):
        c, s, number, error2 = math.cos(line[0]), math.sin(line[0]), 0, 0.0
        a = b = d = u = v = 0.0
        line[2], line[3] = math.inf, -math.inf
        for k in range(count):
            x, y, axis, range_m = readings[k]
            angle = wrapped(line[0] - axis)
            if taken[k] == 1.0 or range_m > ECHO_MAX_M:
                continue
            beside = max(0.0, abs(angle) - half)
            off = c * x + s * y + range_m * math.cos(beside) - line[1]
            taken[k] = FITS if abs(off) <= ON_LINE_M and abs(angle) <= GRAZING_RAD else 0.0
            if taken[k] == 0.0:
                continue
            along = c * y - s * x - math.copysign(range_m * math.sin(beside), angle)
            number += 1
            error2 += off * off
            line[2], line[3] = min(line[2], along), max(line[3], along)
            weight = 1.0 / (1.0 + (off / BENT_MAX_M) ** 2)
            a, b, d = a + weight * along * along, b - weight * along, d + weight
            u, v = u - weight * along * off, v + weight * off
        determinant = a * d - b * b
        if number < LINE_ECHOES_MIN or determinant <= 0.0:
            return 0
        line[4] = math.sqrt(error2 / number)
        turn = (d * u - b * v) / determinant
        share = min(1.0, NORMAL_STEP_RAD / max(abs(turn), ROUNDING))
        line[0] += share * turn
        line[1] += share * (a * v - b * u) / determinant
    return number


@kernel
def _take_near(readings: Floats, count: int, half: float, normal: float, distance: float, taken: Floats) -> None:
    """Take the echoes near a line."""
    for k in range(count):
        x, y, axis, range_m = readings[k]
        angle = abs(wrapped(normal - axis))
        if range_m <= ECHO_MAX_M and angle <= GRAZING_RAD:
            far = math.cos(normal) * x + math.sin(normal) * y + range_m * math.cos(max(0.0, angle - half))
            if abs(far - distance) <= 1.5 * DISTANCE_STEP_M:
                taken[k] = 1.0


@kernel
def _answered(readings: Floats, count: int, half: float, line: Floats) -> float:
    """Return the share of the readings that look at a line, and are not shorter, which come from there."""
    normal, distance, low, high = line[0], line[1], line[2], line[3]
    c, s, agrees, passes = math.cos(normal), math.sin(normal), 0, 0
    for k in range(count):
        x, y, axis, range_m = readings[k]
        angle = wrapped(normal - axis)
        if abs(angle) > GRAZING_RAD:
            continue
        beside = max(0.0, abs(angle) - half)
        expected = (distance - c * x - s * y) / math.cos(beside)
        along = c * y - s * x - math.copysign(expected * math.sin(beside), angle)
        is_inside = low + 2.0 * ON_LINE_M < along < high - 2.0 * ON_LINE_M
        if is_inside and ON_LINE_M < expected < ECHO_MAX_M - 4.0 * ON_LINE_M:
            if range_m > expected + 2.0 * ON_LINE_M:
                passes += beside == 0.0 or range_m <= ECHO_MAX_M  # a mirror is silent at the edge of a beam
            elif range_m > expected - 1.5 * ON_LINE_M:
                agrees += 1
    return agrees / max(1, agrees + passes)


def find_lines(readings: Floats, half: float) -> Iterator[Floats]:
    """Find the lines of readings (n, 4), as of `vote`; yield after each quantum those found so far, shape (k, 5)."""
    count, found = len(readings), np.zeros((LINES_MAX, LINE_FIELDS))
    taken, votes, number = np.zeros(count), np.empty((NORMALS, DISTANCES)), 0
    for _ in range(3 * LINES_MAX):
        votes[:] = 0.0
        for begin in range(0, count, VOTERS):
            vote(readings, begin, min(begin + VOTERS, count), half, taken, votes)
            yield found[:number]
        result = fit_line(readings, count, half, taken, votes, found[number])
        number += result == FOUND
        yield found[:number]
        if result == DONE or number == LINES_MAX:
            break
