"""The walls and round objects of a drive: a first guess by votes, and which reading is an echo of which."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from perception.kernel import Floats
from perception.shared_numbers import BESIDE_MAX_RAD, NORMAL_DIRECTIONS

BIN_M: Final = 0.05
"""Width of the bins in which readings vote, m: what wrong mounts and scales displace them by at first."""
BEARINGS: Final = 9
"""Directions inside a beam in which a reading votes for the centre of a round object."""
UNSURE_RAD: Final = math.radians(4.0)
"""How far nominal directions and beams may be wrong."""
VOTES_MIN: Final = 25
"""Readings that a surface needs at least."""
SHARE_MIN: Final = 0.15
"""Share of the first wall's readings that each further wall needs: less may be a smear of the same wall."""


class Echoes(NamedTuple):
    """Finite readings of a drive, each an array of shape (m,)."""

    firing: NDArray[np.intp]
    sensor: NDArray[np.intp]
    range_m: Floats

    def chosen(self, which: NDArray[np.intp] | slice) -> Echoes:
        """Return some of the readings."""
        return Echoes(self.firing[which], self.sensor[which], self.range_m[which])


class Beams(NamedTuple):
    """Where the sensors of readings stand (m) and look (rad), each an array of shape (m,)."""

    x: Floats
    y: Floats
    axis: Floats


class Surfaces(NamedTuple):
    """Walls as lines, and round objects."""

    walls: Floats
    """(w, 2): direction (rad) of each normal, away from the robot, and normal · point (m)."""
    drums: Floats
    """(k, 3): centre and radius of each round object, m."""

    def distances(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Return distance (m) and bearing (rad) of the answering point of each surface, shape (w + k, m) each."""
        angle, offset = self.walls.T[:, :, None]
        ahead = offset - (np.cos(angle) * x + np.sin(angle) * y)
        dx, dy = self.drums[:, 0, None] - x, self.drums[:, 1, None] - y
        away = np.hypot(dx, dy) - self.drums[:, 2, None]
        bearing = np.concatenate([np.broadcast_to(angle, ahead.shape), np.arctan2(dy, dx)])
        return np.concatenate([ahead, away]), bearing


def find_surfaces(beams: Beams, ranges: Floats, half_angle: float, walls: int, radii: Sequence[float]) -> Surfaces:
    """Return the surfaces for which most readings vote.

    A reading votes for the lines whose normal lies in its beam at its range (Hough), and for the centres of round
    objects along its beam. Each surface is looked for in the readings that no earlier one explains: first a wall,
    then the round objects, whose echoes would else vote for lines, and then further walls.

    Parameters
    ----------
    beams
        The sensors of the readings.
    ranges
        The readings, m, shape (m,).
    half_angle
        Half of the beam's opening, rad.
    walls
        How many walls to look for at most.
    radii
        Radius of each round object, m.
    """
    left = np.ones(len(ranges), dtype=np.bool_)
    found, votes_min = Surfaces(np.empty((0, 2)), np.empty((0, 3))), VOTES_MIN
    for radius in (None, *radii, *(None,) * (walls - 1)):
        rest = Beams(*(part[left] for part in beams))
        if radius is None:
            votes, wall = most_voted_wall(rest, ranges[left], half_angle)
            if votes >= votes_min:
                found = found._replace(walls=np.concatenate([found.walls, [wall]]))
                votes_min = max(votes_min, int(SHARE_MIN * votes))
        else:
            votes, drum = _most_voted_drum(rest, ranges[left], half_angle, radius)
            if votes >= VOTES_MIN:
                found = found._replace(drums=np.concatenate([found.drums, [drum]]))
        left &= ~_explained(found, beams, ranges, half_angle)
    return found


def _explained(found: Surfaces, beams: Beams, ranges: Floats, half_angle: float) -> NDArray[np.bool_]:
    """Return which readings a surface explains, be it as a mirror or, beside the beam, at the beam's edge."""
    distance, bearing = found.distances(beams.x, beams.y)
    turned = np.remainder(bearing - beams.axis + math.pi, 2.0 * math.pi) - math.pi
    beside = np.abs(turned) - half_angle
    least, most = (np.cos(np.clip(beside + unsure, 0.0, BESIDE_MAX_RAD)) for unsure in (-UNSURE_RAD, UNSURE_RAD))
    near = (ranges > distance / least - 2.0 * BIN_M) & (ranges < distance / most + 2.0 * BIN_M)
    explained: NDArray[np.bool_] = np.any(near & (beside < BESIDE_MAX_RAD), axis=0)
    return explained


def most_voted_wall(beams: Beams, ranges: Floats, half_angle: float) -> tuple[int, tuple[float, float]]:
    """Return how many readings vote for the line that has most of them, and its normal's direction and offset.

    Parameters
    ----------
    beams, ranges, half_angle
        As for `find_surfaces`.
    """
    best, wall = 0, (0.0, 0.0)
    for angle in np.linspace(-math.pi, math.pi, NORMAL_DIRECTIONS, endpoint=False):
        turned = np.remainder(angle - beams.axis + math.pi, 2.0 * math.pi) - math.pi
        inside = np.abs(turned) < half_angle
        offset = np.cos(angle) * beams.x[inside] + np.sin(angle) * beams.y[inside] + ranges[inside]
        if len(offset) <= best:
            continue
        # Bins of twice the width, half a width apart: no line falls between two.
        low = offset.min()
        votes = np.bincount(((offset - low) / BIN_M).astype(np.intp), minlength=1)
        votes = votes + np.append(votes[1:], 0)
        if votes.max() > best:
            best, wall = int(votes.max()), (float(angle), float(low + (votes.argmax() + 1) * BIN_M))
    return best, wall


def _most_voted_drum(
    beams: Beams, ranges: Floats, half_angle: float, radius: float
) -> tuple[int, tuple[float, float, float]]:
    """Return how many readings vote for the cell that has most of them, and a round object there: x, y, radius, m."""
    if not len(ranges):
        return 0, (0.0, 0.0, radius)
    angle = beams.axis[:, None] + half_angle * np.linspace(-1.0, 1.0, BEARINGS)
    reach = (ranges + radius)[:, None]
    x, y = beams.x[:, None] + reach * np.cos(angle), beams.y[:, None] + reach * np.sin(angle)
    cell = 2.0 * BIN_M
    columns, rows = ((value - value.min()) / cell for value in (x, y))
    width = int(columns.max()) + 2
    # Each reading votes once for a cell, and for where it lies nearest of several readings of one place.
    cells = np.unique(
        np.stack(
            [
                np.repeat(np.arange(len(ranges)), BEARINGS),
                (rows.astype(np.intp) * width + columns.astype(np.intp)).ravel(),
            ]
        ),
        axis=1,
    )[1]
    votes = np.bincount(cells)
    row, column = divmod(int(votes.argmax()), width)
    return int(votes.max()), (float(x.min() + (column + 0.5) * cell), float(y.min() + (row + 0.5) * cell), radius)
