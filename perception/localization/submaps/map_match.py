"""How well the readings of one map fit another map, and the pose at which they fit best.

A beam meets the cells of its arc at one distance after the other: it goes on with the probability that none of them
answers. What lies where no range came before says nothing: such a reading is worth as much as a known one is on
average where maps fit. Otherwise maps would draw together, as what is known explains more than what is not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from perception.kernel import Floats, kernel
from perception.localization.room.range_likelihood import OUTLIERS
from perception.localization.submaps.local_grid import ECHO_MAX_M, HALF_CELLS, SUBMAP_CELL_M, SUBMAP_CELLS
from perception.shared_numbers import SILENCE_M

MATCH_RAYS: Final = 7
"""Rays of a beam along which the map is asked."""
ANSWERS: Final = 0.2
"""Share of a cell's probability with which one ray is answered. With more, beams end before the surface: drives with
known poses were matched 5 cm short with 0.6, without a bias with 0.2, where their readings also are likeliest."""
MATCH_NOISE_M: Final = 0.08
"""Noise of a range in cells of 0.1 m."""
BEAM_CELLS: Final = 50
"""Cells along a beam, up to `ECHO_MAX_M`."""
UNKNOWN_ANSWER: Final = 0.03
"""Probability that a cell outside the map answers."""
MATCH_TEMPER: Final = 0.1
"""Weight of a reading: those of a few metres of way share the errors of their maps. With 0.1, matches of maps of
real drives deviate as they say (the median of their squared errors over their covariance is 1 to 2 for 3 degrees)."""
POSE_STEP: Final = np.array([0.08, 0.08, 0.03])
"""Differences of place (m) and direction (rad) by which the likelihood's slope and curvature are taken."""
STEP_MOVE_MAX_M: Final = 0.15
"""The most by which one step shifts a match."""
STEP_TURN_MAX_RAD: Final = 0.06
"""The most by which one step turns a match."""
INFORMATION_MIN: Final = 1.0
"""A direction that readings leave free is known to 1 m, or 1 rad."""
SEARCH_STEP_M: Final = 0.15
"""Step of a search in place."""
SEARCH_STEP_RAD: Final = 0.05
"""Step of a search in heading."""
SEARCHED: Final = 8
"""Poses of a search in one quantum."""
SEARCH_READINGS: Final = 80
"""Readings of a search."""
FIT_READINGS: Final = 250
"""Readings of the match that follows a search."""
NEWTON_STEPS: Final = 4
"""Newton steps of that match."""
_AXES: Final = np.eye(3)


@kernel
def fit_of(
    readings: Floats,
    count: int,
    step: int,
    at: Floats,
    beam: Floats,
    maps: Floats,
    goes_on: Floats,
    fit: Floats,
) -> None:
    """Compute how well readings fit a map at a pose.

    Parameters
    ----------
    readings : (n, 4) float
        Sensor's place x, y (m) and direction (rad) in the readings' frame, and range, m.
    count, step : int
        How many there are; each `step`-th is compared.
    at : (3,) float
        Pose of their frame in the map's, m and rad.
    beam : (2,) float
        Half of its opening, rad, and the log likelihood of a known reading where maps fit.
    maps : (2, SUBMAP_CELLS, SUBMAP_CELLS) float
        Probability that a cell answers, and how well it is known.
    goes_on : (BEAM_CELLS,) float
        Overwritten.
    fit : (2,) float
        Overwritten: log likelihood of all readings less the usual one, and the number of known readings.
    """
    c, s = math.cos(at[2]), math.sin(at[2])
    half, usual = beam[0], beam[1]
    total = weight = 0.0
    for k in range(0, count, step):
        range_m = readings[k, 3]
        x = (at[0] + c * readings[k, 0] - s * readings[k, 1]) / SUBMAP_CELL_M + HALF_CELLS
        y = (at[1] + s * readings[k, 0] + c * readings[k, 1]) / SUBMAP_CELL_M + HALF_CELLS
        axis = at[2] + readings[k, 2]
        is_silent = range_m > ECHO_MAX_M
        last = BEAM_CELLS if is_silent else min(BEAM_CELLS, int(range_m / SUBMAP_CELL_M) + 3)
        end = int((SILENCE_M if is_silent else range_m) / SUBMAP_CELL_M)
        known = 0.0
        for n in range(last):
            goes_on[n] = 1.0
        for ray in range(MATCH_RAYS):
            t = 2.0 * (ray + 0.5) / MATCH_RAYS - 1.0
            dx, dy = math.cos(axis + t * half), math.sin(axis + t * half)
            row, column = x + 0.5 * dx, y + 0.5 * dy
            answers = ANSWERS * (1.0 - 0.5 * t * t)
            for n in range(last):
                if 0.0 <= row < SUBMAP_CELLS and 0.0 <= column < SUBMAP_CELLS:
                    i, j = int(row), int(column)
                    goes_on[n] *= 1.0 - answers * maps[0, i, j]
                    if end - 1 <= n <= end:
                        known += maps[1, i, j]
                else:
                    goes_on[n] *= 1.0 - answers * UNKNOWN_ANSWER
                row += dx
                column += dy
        known /= 2 * MATCH_RAYS
        passes, density = 1.0, 0.0
        for n in range(last):
            off = (n + 0.5) * SUBMAP_CELL_M - range_m
            if abs(off) < 3.0 * MATCH_NOISE_M:
                density += passes * (1.0 - goes_on[n]) * math.exp(-0.5 * (off / MATCH_NOISE_M) ** 2)
            passes *= goes_on[n]
        if is_silent:
            likelihood = (1.0 - OUTLIERS) * passes + 0.5 * OUTLIERS
        else:
            likelihood = (1.0 - OUTLIERS) * density / (
                MATCH_NOISE_M * math.sqrt(2.0 * math.pi)
            ) + OUTLIERS / ECHO_MAX_M
        total += known * (math.log(likelihood) - usual)
        weight += known
    fit[0], fit[1] = step * total, step * weight


@kernel
def search(
    readings: Floats,
    count: int,
    step: int,
    lattice: Floats,
    beam: Floats,
    maps: Floats,
    begin: int,
    goes_on: Floats,
    best: Floats,
) -> int:
    """Compare readings with a map at some of the poses of a lattice; return how many there are.

    Parameters
    ----------
    readings, count, step, beam, maps, goes_on
        As of `fit_of`.
    lattice : (5, 3) float
        Pose in its middle; half of its width in x, y (m) and direction (rad); the inverse of that pose's covariance.
    begin : int
        Number of the first pose to be compared.
    best : (9,) float
        The best pose so far and its tempered log density, negative infinity before the first one. Updated; the rest
        is overwritten.
    """
    rows, turns = int(lattice[1, 0] / SEARCH_STEP_M), int(lattice[1, 2] / SEARCH_STEP_RAD)
    side, headings = 2 * rows + 1, 2 * turns + 1
    total = side * side * headings
    at, fit = best[4:7], best[7:9]
    for number in range(begin, min(begin + SEARCHED, total)):
        place, turn = number // headings, number % headings
        dx, dy = (place // side - rows) * SEARCH_STEP_M, (place % side - rows) * SEARCH_STEP_M
        if dx * dx + dy * dy > (lattice[1, 0] + 0.5 * SEARCH_STEP_M) ** 2:
            continue
        dt = (turn - turns) * SEARCH_STEP_RAD
        at[0], at[1], at[2] = lattice[0, 0] + dx, lattice[0, 1] + dy, lattice[0, 2] + dt
        fit_of(readings, count, step, at, beam, maps, goes_on, fit)
        chi = lattice[2, 0] * dx * dx + lattice[3, 1] * dy * dy + lattice[4, 2] * dt * dt
        chi += 2.0 * (lattice[2, 1] * dx * dy + lattice[2, 2] * dx * dt + lattice[3, 2] * dy * dt)
        score = MATCH_TEMPER * fit[0] - 0.5 * chi
        if score > best[3]:
            best[0], best[1], best[2], best[3] = at[0], at[1], at[2], score
    return total


class Match(NamedTuple):
    """The pose at which readings fit a map best."""

    pose: Floats
    """x, y (m) and direction (rad), shape (3,)."""
    information: Floats
    """The inverse of its covariance, shape (3, 3)."""
    log_likelihood: float
    """Of the known readings, less what is usual."""
    known: float
    """Number of known readings."""


def best_match(
    readings: Floats, maps: Floats, beam: Floats, about: Floats, reach: Floats, information: Floats
) -> Iterator[Match | None]:
    """Search for the pose at which readings fit best, and climb to the best one near it.

    Parameters
    ----------
    readings, maps, beam
        As of `fit_of`.
    about, reach : (3,) float
        Expected pose, and how far from it is looked, m and rad.
    information : (3, 3) float
        Of the expected pose, for the search; the match is what the readings say alone.

    Yields
    ------
    Match or None
        None after each quantum, and the match last.
    """
    count, goes_on, fit = len(readings), np.empty(BEAM_CELLS), np.empty(2)
    lattice, best = np.vstack([about, reach, information]), np.full(9, -math.inf)
    step, begin, total = max(1, count // SEARCH_READINGS), 0, 1
    while begin < total:
        total = search(readings, count, step, lattice, beam, maps, begin, goes_on, best)
        begin += SEARCHED
        yield None
    step = max(1, count // FIT_READINGS)

    def log_density(at: Floats) -> float:
        fit_of(readings, count, step, at, beam, maps, goes_on, fit)
        return MATCH_TEMPER * float(fit[0])

    at = best[:3].copy()
    for _ in range(NEWTON_STEPS):
        here, slope = log_density(at), np.zeros(3)
        plus, minus, curvature = np.zeros(3), np.zeros(3), np.zeros((3, 3))
        for i in range(3):
            plus[i], minus[i] = log_density(at + POSE_STEP * _AXES[i]), log_density(at - POSE_STEP * _AXES[i])
            slope[i] = (plus[i] - minus[i]) / (2.0 * POSE_STEP[i])
            curvature[i, i] = (plus[i] + minus[i] - 2.0 * here) / POSE_STEP[i] ** 2
            yield None
        for i, j in ((1, 0), (2, 0), (2, 1)):
            both = POSE_STEP * (_AXES[i] + _AXES[j])
            mixed = log_density(at + both) + log_density(at - both)
            mixed += 2.0 * here - plus[i] - minus[i] - plus[j] - minus[j]
            curvature[i, j] = curvature[j, i] = mixed / (2.0 * POSE_STEP[i] * POSE_STEP[j])
            yield None
        values, axes = np.linalg.eigh(-curvature)
        values = np.maximum(values, INFORMATION_MIN)
        move = axes @ ((axes.T @ slope) / values)
        share = min(
            1.0,
            STEP_MOVE_MAX_M / max(1e-9, math.hypot(move[0], move[1])),
            STEP_TURN_MAX_RAD / max(1e-9, abs(move[2])),
        )
        at = at + share * move
    log_likelihood = log_density(at) / MATCH_TEMPER
    yield Match(at, (axes * values) @ axes.T, log_likelihood, float(fit[1]))
