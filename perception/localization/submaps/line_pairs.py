"""What the straight walls of a map say of its pose beside the maps before it.

Each line of the map is paired once with the line before that is most probably of the same wall, by what the match of
cells (`perception.localization.submaps.map_match`) says of the pose; then lines and cells give the pose together.
Lines give the direction of the next map to 0.01 to 0.02 rad, where cells give it to 0.06.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from perception.angles import wrapped
from perception.kernel import Floats, kernel

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
POSE_ROUNDS: Final = 4
"""Steps to the pose that fits best."""


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
    one, other : (`map_lines.LINE_FIELDS`,) float
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
