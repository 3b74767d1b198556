"""One fit of all sure walls and of the corners that are heard.

Between mirrors an inside corner answers from far around, so its echoes place it well, on both of its walls. A wall of
which few places answered is known only near these; its corners at both ends say which way it runs. So the lines and
the corners are fitted together, by linear least squares about their present places.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.bayes.walls.corners import CORNER_ECHOES_MIN, CORNER_SYSTEMATIC_M, KEPT
from perception.kernel import Floats
from perception.records import Structured
from perception.shared_numbers import OUTLIER_SIGMAS

PLACE_INFORMATION: Final = 1.0
"""Prior information on a corner's place, m⁻²: its echoes, if all of one bearing, leave it open across."""


@dataclass(frozen=True, slots=True)
class Lines:
    """The lines of walls in their frames."""

    frames: Floats
    """(n, 4): origin (m) and normal of each frame."""
    lines: Floats
    """(n, 5): offset (m), slope, and their variance (m²), covariance (m) and variance."""


@dataclass(frozen=True, slots=True)
class Incidences:
    """Points that lie on lines, linear about the present: offset + slope · along + row · place = level."""

    points: NDArray[np.int64]
    lines: NDArray[np.int64]
    """(n,): which point lies on which line."""
    along: Floats
    """(n,): position along the line's frame, m."""
    rows: Floats
    """(n, 2): factors of the point's place."""
    levels: Floats
    """(n,): what the sum is to be, m."""


def fit_together(walls: Lines, corners: Structured, numbers: Sequence[int]) -> Floats:
    """Return the lines of walls, corrected by the corners that are heard on them, which are corrected in place.

    Parameters
    ----------
    walls : Lines
        The walls.
    corners : (m,) record of `RoomCorner`
        Corners of any walls, `second` −1 where only one is known; those that are heard get their new places.
    numbers : sequence of int
        The walls' numbers, by which corners refer to them.
    """
    is_heard = (corners["is_used"] == KEPT) & (corners["is_edge"] == 0) & (corners["echoes"] >= CORNER_ECHOES_MIN)
    heard = np.flatnonzero(is_heard & (corners["echoes"] > corners["passes"]))
    points = corners[heard]
    known = {number: place for place, number in enumerate(numbers)}
    owners = [[known.get(number, -1) for number in points[name].tolist()] for name in ("first", "second")]
    pairs = np.array([(c, k) for side in owners for c, k in enumerate(side) if k >= 0], np.int64).reshape(-1, 2)
    held = _agreeing(walls, points, _incidences(walls, points, pairs))
    if len(held.points) == 0:
        return walls.lines
    kept = np.unique(held.points)
    lines, places, covariances = _solve(walls, points[kept], held, np.searchsorted(kept, held.points))
    at = heard[kept]
    corners["x"][at], corners["y"][at] = places.T
    corners["covariance_xx"][at], corners["covariance_xy"][at], corners["covariance_yy"][at] = covariances.T
    return lines


def _incidences(walls: Lines, points: Structured, pairs: NDArray[np.int64]) -> Incidences:
    at, on = pairs.T
    ox, oy, nx, ny = walls.frames[on].T
    x, y, slope = points["x"][at], points["y"][at], walls.lines[on, 1]
    along, across = nx * (y - oy) - ny * (x - ox), nx * (x - ox) + ny * (y - oy)
    rows = np.column_stack([-nx - slope * ny, slope * nx - ny])
    return Incidences(at, on, along, rows, across + rows[:, 0] * x + rows[:, 1] * y)


def _agreeing(walls: Lines, points: Structured, all_: Incidences) -> Incidences:
    """Return those that the points' own echoes do not contradict."""
    heard = points["heard"][all_.points]
    xx, xy, yy = heard["xx"] + PLACE_INFORMATION, heard["xy"], heard["yy"] + PLACE_INFORMATION
    x = heard["x"] + PLACE_INFORMATION * points["x"][all_.points]
    y = heard["y"] + PLACE_INFORMATION * points["y"][all_.points]
    det = xx * yy - xy * xy
    rx, ry = all_.rows.T
    offset, slope, variance, covariance, of_slope = walls.lines[all_.lines].T
    error = offset + slope * all_.along - all_.levels
    error += (rx * (yy * x - xy * y) + ry * (xx * y - xy * x)) / det
    spread = (rx * rx * yy - 2.0 * rx * ry * xy + ry * ry * xx) / det + CORNER_SYSTEMATIC_M**2
    spread += variance + 2.0 * all_.along * covariance + all_.along**2 * of_slope
    agrees = np.abs(error) < OUTLIER_SIGMAS * np.sqrt(spread)
    return Incidences(*(values[agrees] for values in (all_.points, all_.lines, all_.along, all_.rows, all_.levels)))


def _solve(
    walls: Lines, points: Structured, held: Incidences, at: NDArray[np.int64]
) -> tuple[Floats, Floats, Floats]:
    """Return the lines (n, 5), and the points' places (m, 2) and covariances xx, xy, yy (m, 3).

    Parameters
    ----------
    walls, points, held
        The walls, the points, and which of these lie on which.
    at : (k,) int
        The points of `held` as places in `points`.
    """
    lines, n = walls.lines.copy(), 2 * len(walls.lines)
    a, b = 2 * np.arange(len(lines)), n + 2 * np.arange(len(points))
    information, weighed = np.zeros((n + 2 * len(points),) * 2), np.zeros(n + 2 * len(points))
    det = lines[:, 2] * lines[:, 4] - lines[:, 3] ** 2
    _add_blocks(information, a, lines[:, 4] / det, -lines[:, 3] / det, lines[:, 2] / det)
    weighed[:n] = information[:n, :n] @ lines[:, :2].ravel()
    heard = points["heard"]
    _add_blocks(information, b, heard["xx"] + PLACE_INFORMATION, heard["xy"], heard["yy"] + PLACE_INFORMATION)
    weighed[b] = heard["x"] + PLACE_INFORMATION * points["x"]
    weighed[b + 1] = heard["y"] + PLACE_INFORMATION * points["y"]
    rows, k = np.zeros((len(at), len(weighed))), np.arange(len(at))
    rows[k, 2 * held.lines], rows[k, 2 * held.lines + 1] = 1.0, held.along
    rows[k, b[at]], rows[k, b[at] + 1] = held.rows.T
    information += rows.T @ rows / CORNER_SYSTEMATIC_M**2
    weighed += held.levels @ rows / CORNER_SYSTEMATIC_M**2
    covariance: Floats = np.asarray(np.linalg.inv(information), np.float64)
    fitted = covariance @ weighed
    lines[:, :2] = fitted[:n].reshape(-1, 2)
    lines[:, 2:] = _blocks(covariance, a)
    return lines, fitted[n:].reshape(-1, 2), _blocks(covariance, b)


def _add_blocks(matrix: Floats, at: NDArray[np.int64], xx: Floats, xy: Floats, yy: Floats) -> None:
    """Add symmetric 2 × 2 blocks on the diagonal that begin in these rows."""
    matrix[at, at] += xx
    matrix[at, at + 1] += xy
    matrix[at + 1, at] += xy
    matrix[at + 1, at + 1] += yy


def _blocks(matrix: Floats, at: NDArray[np.int64]) -> Floats:
    """Return xx, xy and yy of the 2 × 2 blocks on the diagonal that begin in these rows, shape (n, 3)."""
    return np.column_stack([matrix[at, at], matrix[at, at + 1], matrix[at + 1, at + 1]])
