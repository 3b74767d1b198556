"""The evidence of one cell in one direction: log odds in whole numbers, which fade with the robot's way.

The strongest hit and the strongest passage at a place are kept beside what was known before it, so that the same
reading again changes nothing, and neither does the order of readings.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.kernel import Floats, Ints, kernel
from perception.mapping.grid.window import OCTANTS, octant
from perception.shared_numbers import NO_NUMBER

UNDIRECTED_UNIT: Final = 2.0
"""An echo's unit of evidence in the undirected evidence."""
UNDIRECTED: Final = OCTANTS
"""Index of the undirected evidence of a cell, behind those of the looking directions."""
BASE, HIT, PASSAGE, STAMP = range(4)
"""What is kept of each evidence: its value when the robot came to this place; the strongest hit and the strongest
passage since; and the place."""
NAT: Final = 1024
"""One nat of log odds; evidence is kept in whole numbers, which replay to the bit."""
PLACE_NUMBERS: Final = 1 << 15
"""Places are numbered modulo this."""
CERTAIN: Final = 3 * NAT
"""Greatest evidence for and against, so that contradiction is soon seen."""
SURE: Final = NAT // 2
"""A cell of so much evidence answers."""
FAINT: Final = int(0.1 * NAT)
"""Directed evidence up to this is as good as none: any cell of a single echo's arc has it."""
FADING_PLACES: Final = 50
"""Evidence loses one unit for each so many places: 1 nat on 5 km of way, on which odometry has drifted through the
window; the faint evidence of one echo is gone after a few hundred metres."""

Cells = NDArray[np.int16]
Flags = NDArray[np.bool_]


@kernel
def evidence_now(kept: Cells, place: int) -> int:
    """Return the evidence of a cell in one direction, faded by the way since it was last renewed.

    Parameters
    ----------
    kept : (4,) int16
        As kept.
    place : int
        Where the robot is now.
    """
    value = min(CERTAIN, max(-CERTAIN, int(kept[BASE]) + int(kept[HIT]) + int(kept[PASSAGE])))
    faded = ((place - int(kept[STAMP])) & (PLACE_NUMBERS - 1)) // FADING_PLACES
    return max(0, value - faded) if value > 0 else min(0, value + faded)


@kernel
def renew(kept: Cells, place: int) -> None:
    """Begin a new place: what was found at the last one becomes the base."""
    if kept[STAMP] != place:
        kept[BASE] = evidence_now(kept, place)
        kept[HIT] = 0
        kept[PASSAGE] = 0
        kept[STAMP] = place


@kernel
def is_sure_elsewhere(planes: Cells, maybe_sure: Flags, iy: int, ix: int, own: int, place: int) -> bool:
    """Return whether a cell is `SURE` in any looking direction but one, without this place's readings.

    Parameters
    ----------
    planes : (9, n, n, 4) int16
        The evidence of all cells.
    maybe_sure : (n, n) bool
        False for cells whose hits are not enough for that in any direction, as almost everywhere. Updated.
    iy, ix : int
        The cell.
    own : int
        The direction that is left out.
    place : int
        Where the robot is now.
    """
    if not maybe_sure[iy, ix]:
        return False
    most = 0
    for k in range(OCTANTS):
        most = max(most, int(planes[k, iy, ix, BASE]) + int(planes[k, iy, ix, HIT]))
    if most < SURE:  # what was passed and what has faded only lessens it
        maybe_sure[iy, ix] = False
        return False
    for k in range(OCTANTS):
        kept = planes[k, iy, ix]
        if k != own and (int(kept[BASE]) if kept[STAMP] == place else evidence_now(kept, place)) >= SURE:
            return True
    return False


@kernel
def fill_sure(planes: Cells, maybe_sure: Flags, place: int, out: Flags) -> None:
    """Write which cells are `SURE` in some looking direction.

    Parameters
    ----------
    planes, maybe_sure, place
        As of `is_sure_elsewhere`; nothing is updated.
    out : (n, n) bool
        Out.
    """
    for iy in range(maybe_sure.shape[0]):
        for ix in range(maybe_sure.shape[1]):
            out[iy, ix] = False
            if maybe_sure[iy, ix]:
                for k in range(OCTANTS):
                    if evidence_now(planes[k, iy, ix], place) >= SURE:
                        out[iy, ix] = True
                        break


@kernel
def without_hits(kept: Cells) -> int:
    """Return the evidence of a cell in one direction, this place's hits left out."""
    return min(CERTAIN, max(-CERTAIN, int(kept[BASE]) + int(kept[PASSAGE])))


def make_draws() -> Floats:
    """Return how much of an echo a cell draws by its evidence, from −`CERTAIN`: the square of its probability."""
    return np.array([(1.0 / (1.0 + math.exp(-value / NAT))) ** 2 for value in range(-CERTAIN, CERTAIN + 1)])


@kernel
def hit_nat(share: float) -> int:
    """Return the evidence of a share of an echo, in units."""
    q = 0.5 + 0.49 * min(1.0, share)
    return int(NAT * math.log(q / (1.0 - q)))


@kernel
def fill_probability(
    planes: Cells,
    corner: Ints,
    cell_m: float,
    place: int,
    mirrors: float,
    from_x: float,
    from_y: float,
    odds: NDArray[np.float32],
    out: NDArray[np.float32],
) -> None:
    """Write the probability of each cell.

    Parameters
    ----------
    planes, corner, cell_m, place
        As of `directed.enter_readings`.
    mirrors : float
        Weight of the looking directions, 0 to 1, where they are asked together; the rest is that of the undirected.
    from_x, from_y : float
        The place from which the cells are asked, m; NaN: from any direction.
    odds : (2 CERTAIN + 1,) float32
        Probability by evidence, from −`CERTAIN`.
    out : (n, n) float32
        Out: the probabilities, row by row from the smallest y.
    """
    mask = planes.shape[1] - 1
    for row in range(mask + 1):
        iy = int(corner[1]) + row
        jy = iy & mask
        for column in range(mask + 1):
            ix = int(corner[0]) + column
            jx = ix & mask
            both = planes[UNDIRECTED, jy, jx]
            if both[STAMP] == NO_NUMBER:
                out[row, column] = odds[CERTAIN]
                continue
            if math.isnan(from_x):
                most = 0
                least = 0
                for k in range(OCTANTS if mirrors > 0.0 else 0):
                    kept = planes[k, jy, jx]
                    if kept[STAMP] != NO_NUMBER:
                        value = evidence_now(kept, place)
                        most = max(most, value)
                        least = min(least, value)
                directed = max(0, most - FAINT) if most > 0 else least
                value = int(mirrors * directed + (1.0 - mirrors) * evidence_now(both, place))
            else:
                k = octant((ix + 0.5) * cell_m - from_x, (iy + 0.5) * cell_m - from_y)
                value = evidence_now(planes[k, jy, jx], place)
                value = max(0, value - FAINT) if value > 0 else value
            out[row, column] = odds[CERTAIN + value]


@kernel
def enter_hits(
    planes: Cells, maybe_sure: Flags, place: int, unit: float, arc: Ints, shares: Floats, draws: Floats
) -> None:
    """Share each echo over its arc.

    Parameters
    ----------
    planes, maybe_sure, place, shares, draws
        As of `directed.enter_readings`.
    unit : float
        The unit of evidence in a looking direction.
    arc : (m, 4) int
        As of `directed.enter_readings`; cells for the undirected evidence only have that in place of a looking
        direction.
    """
    first = 0
    while first < len(arc):
        last = first
        total = 0.0
        total_both = 0.0
        while last < len(arc) and arc[last, 3] == arc[first, 3]:
            share = shares[last, 0]
            own = planes[arc[last, 2], arc[last, 0], arc[last, 1]]
            renew(own, place)
            both = planes[UNDIRECTED, arc[last, 0], arc[last, 1]]
            renew(both, place)
            shares[last, 0] = share * draws[CERTAIN + without_hits(own)]
            shares[last, 1] = share * draws[CERTAIN + without_hits(both)]
            if arc[last, 2] != UNDIRECTED:
                total += shares[last, 0]
            total_both += shares[last, 1]
            last += 1
        for n in range(first, last):
            if arc[n, 2] != UNDIRECTED:
                own = planes[arc[n, 2], arc[n, 0], arc[n, 1]]
                own[HIT] = max(int(own[HIT]), hit_nat(unit * shares[n, 0] / total))
                if int(own[BASE]) + int(own[HIT]) >= SURE:
                    maybe_sure[arc[n, 0], arc[n, 1]] = True
            both = planes[UNDIRECTED, arc[n, 0], arc[n, 1]]
            both[HIT] = max(int(both[HIT]), hit_nat(UNDIRECTED_UNIT * shares[n, 1] / total_both))
        first = last
