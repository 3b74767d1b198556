"""Outline segments from pairs of readings, each with its uncertainty, and the map that holds them.

A pair may be two readings of one sensor or of neighbours in one firing, at whatever baseline. A short baseline gives
a segment early and a poor direction, a long one late and a good one; so each carries what it knows, and hypotheses
start from the surest. The map is a hashed grid of small buckets: a cell's newest segments push out its oldest, and a
bucket whose hash is wanted by another cell changes hands. Its size and the cost of a look-up do not grow with the
mission, and what has gone is written over by what is seen instead.
"""

from __future__ import annotations

import math
from typing import Final

from perception.kernel import Floats, Ints, kernel

SEG: Final = 7
"""Columns of a segment: middle x, y (m), unit normal x, y, length (m), σ along the normal (m), of direction (rad)."""

SHORTEST: Final = 1e-6
"""A segment's length (m) counts as at least this much where its direction's σ is reckoned."""

X_PRIME: Final = 73856093
Y_PRIME: Final = 19349663
"""Primes of the spatial hash of Teschner et al., Optimized Spatial Hashing (VMV 2003), §3."""


@kernel
def tangent(
    x1: float,
    y1: float,
    ux1: float,
    uy1: float,
    r1: float,
    x2: float,
    y2: float,
    ux2: float,
    uy2: float,
    r2: float,
    cos_half: float,
    var_r: float,
    out: Floats,
) -> bool:
    """Find the line that touches the arcs of two ranges inside both beams, and how well it is known.

    McKerrow's construction (1993; paper §3.2, Figure 2): the tangent's normal makes the angle acos((r1 − r2)/L) with
    the baseline of length L. Both ends carry an independent error of variance `var_r` along the normal, so that the
    middle has var_r / 2 and the direction √(2 var_r) / (length of the segment).

    Parameters
    ----------
    x1, y1, ux1, uy1, r1 : float
        First reading: place (m), unit axis, range (m).
    x2, y2, ux2, uy2, r2 : float
        Second reading.
    cos_half : float
        Cosine of half the beam's opening.
    var_r : float
        Variance of a range, m².
    out : (SEG,) float
        Out: the segment, where there is one.

    Returns
    -------
    bool
        Whether there is a tangent. Where there are two, the one nearer to both axes is taken.
    """
    base = math.sqrt((x2 - x1) * (x2 - x1) + (y2 - y1) * (y2 - y1))
    if base == 0.0 or abs(r1 - r2) > base:
        return False
    cos_open = (r1 - r2) / base
    sin_open = math.sqrt(1.0 - cos_open * cos_open)
    ex = (x2 - x1) / base
    ey = (y2 - y1) / base
    best = -2.0
    nx = 0.0
    ny = 0.0
    for side in (-1.0, 1.0):
        ax = ex * cos_open - side * ey * sin_open
        ay = ey * cos_open + side * ex * sin_open
        off1 = ax * ux1 + ay * uy1
        off2 = ax * ux2 + ay * uy2
        if off1 >= cos_half and off2 >= cos_half and off1 + off2 > best:
            best = off1 + off2
            nx = ax
            ny = ay
    if best == -2.0:
        return False
    length = base * sin_open
    out[0] = 0.5 * (x1 + r1 * nx + x2 + r2 * nx)
    out[1] = 0.5 * (y1 + r1 * ny + y2 + r2 * ny)
    out[2] = nx
    out[3] = ny
    out[4] = length
    out[5] = math.sqrt(0.5 * var_r)
    out[6] = math.sqrt(2.0 * var_r) / max(length, SHORTEST)
    return True


@kernel
def cell_slot(ix: int, iy: int, slots: int) -> int:
    """Return the bucket of a cell of the grid: its hash among `slots`, a power of two."""
    return ((ix * X_PRIME) ^ (iy * Y_PRIME)) & (slots - 1)


@kernel
def map_add(seg: Floats, cell: float, tags: Ints, fill: Ints, store: Floats) -> int:
    """Put a segment into its cell's bucket, and return which one that is.

    A full bucket forgets its oldest segment. A bucket that another cell holds is emptied and taken over.

    Parameters
    ----------
    seg : (≥ 4,) float
        Middle x, y (m), unit normal x, y.
    cell : float
        Side of a cell, m.
    tags : (slots, 2) int
        Which cell holds each bucket. Updated.
    fill : (slots,) int
        Segments put into each bucket since its cell took it. Updated.
    store : (slots, capacity, 4) float
        The buckets. Updated.
    """
    ix = math.floor(seg[0] / cell)
    iy = math.floor(seg[1] / cell)
    k = cell_slot(ix, iy, tags.shape[0])
    if tags[k, 0] != ix or tags[k, 1] != iy:
        tags[k, 0] = ix
        tags[k, 1] = iy
        fill[k] = 0
    j = fill[k] % store.shape[1]
    for q in range(4):
        store[k, j, q] = seg[q]
    fill[k] += 1
    return k


@kernel
def map_near(
    x: float, y: float, radius: float, cell: float, tags: Ints, fill: Ints, store: Floats, out: Floats
) -> int:
    """Copy the segments whose middles lie within `radius` of a point.

    Parameters
    ----------
    x, y, radius : float
        Metres.
    cell, tags, fill, store
        As for `map_add`.
    out : (m, 4) float
        Out: middle x, y (m), unit normal x, y. What does not fit is left out.

    Returns
    -------
    int
        How many were copied.
    """
    n = 0
    for ix in range(math.floor((x - radius) / cell), math.floor((x + radius) / cell) + 1):
        for iy in range(math.floor((y - radius) / cell), math.floor((y + radius) / cell) + 1):
            k = cell_slot(ix, iy, tags.shape[0])
            if tags[k, 0] != ix or tags[k, 1] != iy:
                continue
            for j in range(min(fill[k], store.shape[1])):
                if n >= out.shape[0]:
                    return n
                if (store[k, j, 0] - x) ** 2 + (store[k, j, 1] - y) ** 2 < radius * radius:
                    for q in range(4):
                        out[n, q] = store[k, j, q]
                    n += 1
    return n
