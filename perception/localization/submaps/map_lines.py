"""Straight walls of a map of a few metres of way, and what they say of its pose beside the maps before it.

A line is found by votes (Hough; Tardós, Neira, Newman, Leonard, "Robust mapping and localization in indoor
environments using sonar data", IJRR 21(4), 2002): a range says for each direction of its normal how far it lies, as
the echo came from the wall's nearest point in the beam. A rough wall answers each beam that meets it, a mirror those
square to it; a line through which many ranges pass is none. Lines give the direction of the next map to 0.01 to 0.02
rad, where the cells of `perception.localization.submaps.map_match` give it to 0.06.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from perception.angles import ROUNDING_RAD, wrapped
from perception.kernel import Floats, kernel
from perception.localization.submaps.local_grid import ECHO_MAX_M, HALF_CELLS, SUBMAP_CELL_M

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
BENDS: Final = 3.0
"""Deviations of a wall, from one end to the other, that are independent of each other. With so many, pairs of lines
differ as expected: by 0.5 to 1.8 σ, as the median of five drives with exact poses says."""
PAIR_RAD: Final = 0.35
"""Lines that differ by more are not of one wall, rad."""
PAIR_M: Final = 0.4
"""Lines that lie farther apart are not of one wall, m."""
SHARED_M: Final = 0.8
"""Length that two lines of one wall have in common, m: a third to half of those with less are of two walls."""
FALSE_PAIRS: Final = 0.1
"""Share of pairs that are not of one wall."""
LINE_ROUNDS: Final = 8
POSE_ROUNDS: Final = 4
"""Steps to the line, and to the pose, that fits best."""
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
            beside = max(0.0, abs(direction - axis) - half - ROUNDING_RAD)
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
        share = min(1.0, NORMAL_STEP_RAD / max(abs(turn), ROUNDING_RAD))
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


def moved_lines(lines: Floats, pose: Floats) -> Floats:
    """Return lines (n, 5) of a map that lies at a pose (m, rad) as lines of the map where it lies."""
    moved = lines.copy()
    moved[:, 0] += pose[2]
    c, s = np.cos(moved[:, 0]), np.sin(moved[:, 0])
    moved[:, 1] += c * pose[0] + s * pose[1]
    moved[:, 2:4] += (c * pose[1] - s * pose[0])[:, None]
    return moved


@kernel
def compare(one: Floats, other: Floats, pose: Floats, difference: Floats) -> bool:
    """Compare a line of a map with one before, as of `pull`; return whether they may be of one wall.

    Parameters
    ----------
    one, other : (LINE_FIELDS,) float
        That of the map, and the one before.
    pose : (3,) float
        Of the map, m and rad.
    difference : (7,) float
        Overwritten: turn (rad) and distance (m) where both are, their variances, and the distance's derivatives by
        the pose. Turn and distance are added as if they were independent.
    """
    normal = one[0] + pose[2]
    c, s, turn = math.cos(normal), math.sin(normal), wrapped(normal - other[0])
    shift = c * pose[1] - s * pose[0]
    low, high = max(other[2], one[2] + shift), min(other[3], one[3] + shift)
    at = 0.5 * (low + high)
    off = one[1] + c * pose[0] + s * pose[1] - turn * at - other[1]
    turn_variance, off_variance = _variances(one[2], one[3], one[4], at - shift)
    other_turn, other_off = _variances(other[2], other[3], other[4], at)
    difference[0], difference[1] = turn, off
    difference[2] = turn_variance + other_turn
    difference[3] = off_variance + other_off
    difference[4], difference[5], difference[6] = c, s, shift - at
    return high - low >= SHARED_M and abs(turn) <= PAIR_RAD and abs(off) <= PAIR_M


@kernel
def find_pairs(
    before: Floats, lines: Floats, pose: Floats, covariance: Floats, difference: Floats, pairs: Floats
) -> None:
    """Find the line before that is most probably of one wall with each line of a map.

    Parameters
    ----------
    before, lines, pose
        As of `pull`.
    covariance : (3, 3) float
        Of the pose.
    difference : (7,) float
        Overwritten.
    pairs : (n, 2) float
        Overwritten: the number of that line, and the probability that it is; 0 where another wall is more probable.
    """
    for k in range(len(lines)):
        pairs[k, 0] = pairs[k, 1] = 0.0
        best = FALSE_PAIRS / (4.0 * PAIR_RAD * PAIR_M)
        for n in range(len(before)):
            if not compare(lines[k], before[n], pose, difference):
                continue
            turn, off, turn_variance, off_variance, x, y, theta = difference
            place = x * x * covariance[0, 0] + 2.0 * x * y * covariance[0, 1] + y * y * covariance[1, 1]
            both = x * covariance[0, 2] + y * covariance[1, 2]
            a, b = covariance[2, 2] + turn_variance, both + theta * covariance[2, 2]
            d = off_variance + place + theta * (both + b)
            determinant = a * d - b * b
            chi = (d * turn * turn - 2.0 * b * turn * off + a * off * off) / determinant
            density = (1.0 - FALSE_PAIRS) * math.exp(-0.5 * chi) / (2.0 * math.pi * math.sqrt(determinant))
            if density > best:
                best, pairs[k, 0] = density, n
                pairs[k, 1] = density / (density + FALSE_PAIRS / (4.0 * PAIR_RAD * PAIR_M))


@kernel
def pull(before: Floats, lines: Floats, pose: Floats, pairs: Floats, difference: Floats, system: Floats) -> None:
    """Add what pairs of lines say of a map's pose.

    Parameters
    ----------
    before : (m, LINE_FIELDS) float
        Of the maps before, in one frame.
    lines : (n, LINE_FIELDS) float
        Of the map.
    pose : (3,) float
        Of the map in that frame, m and rad.
    pairs : (n, 2) float
        As of `find_pairs`.
    difference : (7,) float
        Overwritten.
    system : (3, 4) float
        Information and, in its last column, force: the information times the step to the pose. Updated.
    """
    for k in range(len(lines)):
        if pairs[k, 1] > 0.0:
            compare(lines[k], before[int(pairs[k, 0])], pose, difference)
            turn, off, turn_variance, off_variance, x, y, theta = difference
            _add(system, 0.0, 0.0, 1.0, pairs[k, 1] / turn_variance, turn)
            _add(system, x, y, theta, pairs[k, 1] / off_variance, off)


@kernel
def _variances(low: float, high: float, bent: float, at: float) -> tuple[float, float]:
    """Return the variances of a line's direction (rad²), and of its distance (m²) at a place along it."""
    ratio, lever = 12.0 / (high - low) ** 2, at - 0.5 * (low + high)
    return bent * bent * ratio / BENDS, bent * bent * (1.0 + ratio * lever * lever) / BENDS


@kernel
def _add(system: Floats, x: float, y: float, theta: float, information: float, error: float) -> None:
    """Add an error and its derivatives by the pose to `system`, as of `pull`."""
    system[0, 0] += information * x * x
    system[0, 1] += information * x * y
    system[0, 2] += information * x * theta
    system[1, 1] += information * y * y
    system[1, 2] += information * y * theta
    system[2, 2] += information * theta * theta
    system[1, 0], system[2, 0], system[2, 1] = system[0, 1], system[0, 2], system[1, 2]
    system[0, 3] -= information * x * error
    system[1, 3] -= information * y * error
    system[2, 3] -= information * theta * error


def with_lines(before: Floats, lines: Floats, pose: Floats, information: Floats) -> tuple[Floats, Floats]:
    """Return the pose, and the inverse of its covariance, that lines and a match of cells give together.

    Parameters
    ----------
    before, lines
        As of `pull`.
    pose : (3,) float
        Of the match, m and rad.
    information : (3, 3) float
        Of the match.
    """
    here, system = pose, np.column_stack([information, np.zeros(3)])
    pairs, difference = np.empty((len(lines), 2)), np.empty(7)
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    find_pairs(before, lines, pose, covariance, difference, pairs)
    for _ in range(POSE_ROUNDS):
        system[:, :3], system[:, 3] = information, information @ (pose - here)
        pull(before, lines, here, pairs, difference, system)
        here = here + np.linalg.solve(system[:, :3], system[:, 3])
    return here, system[:, :3].copy()
