"""Construction of outline segments from pairs of readings, and the map that holds them.

A pair may be two readings of one sensor or of neighbours in one firing, at any baseline. A short baseline gives a
segment early and a poor direction, a long one late and a good one; so each carries its uncertainty, and hypotheses
start from the surest. The map is a hashed grid of small buckets: a cell's newest segments push out its oldest, and a
another cell of the same hash takes a bucket over. Its size and the cost of a look-up do not grow with the
mission, and what has gone is overwritten by what is seen instead.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.memory.elements import BUCKET_CAPACITY, MappedSegment, Reading
from perception.bayes.memory.scratch import PairSegment
from perception.bayes.memory.state import Bucket
from perception.kernel import kernel
from perception.records import Records

LENGTH_MIN_M: Final = 1e-6
"""A segment counts as at least this long where the σ of its direction is computed."""

X_PRIME: Final = 73856093
Y_PRIME: Final = 19349663
"""Primes of the spatial hash of Teschner et al., Optimized Spatial Hashing (VMV 2003), §3."""


@kernel
def tangent(first: Reading, second: Reading, cos_half: float, var_r: float, out: PairSegment) -> bool:
    """Write the common tangent of two ranges' arcs inside both beams, with its uncertainty; return whether it exists.

    McKerrow's construction (1993; paper §3.2, Figure 2): the tangent's normal makes the angle acos((r1 − r2)/L) with
    the baseline of length L. Both ends carry an independent error of variance `var_r` along the normal, so that the
    middle has var_r / 2 and the direction √(2 var_r) / (length of the segment).

    Parameters
    ----------
    first, second : Reading
        The readings.
    cos_half : float
        Cosine of half the beam's opening.
    var_r : float
        Variance of a range, m².
    out : PairSegment
        Out: the segment, where there is one, but for `reading`.

    Returns
    -------
    bool
        Whether there is a tangent. Where there are two, the one nearer to both axes is taken.
    """
    x1, y1, r1 = first.x, first.y, first.range_m
    x2, y2, r2 = second.x, second.y, second.range_m
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
        off1 = ax * first.axis_x + ay * first.axis_y
        off2 = ax * second.axis_x + ay * second.axis_y
        if off1 >= cos_half and off2 >= cos_half and off1 + off2 > best:
            best = off1 + off2
            nx = ax
            ny = ay
    if best == -2.0:
        return False
    length = base * sin_open
    out.x = 0.5 * (x1 + r1 * nx + x2 + r2 * nx)
    out.y = 0.5 * (y1 + r1 * ny + y2 + r2 * ny)
    out.normal_x = nx
    out.normal_y = ny
    out.length = length
    out.sigma_normal = math.sqrt(0.5 * var_r)
    out.sigma_direction = math.sqrt(2.0 * var_r) / max(length, LENGTH_MIN_M)
    return True


@kernel
def bucket_index(cell_x: int, cell_y: int, buckets: int) -> int:
    """Return the index of a grid cell's bucket: the cell's spatial hash (Teschner et al. 2003, §3).

    Parameters
    ----------
    cell_x, cell_y : int
        Indices of the cell.
    buckets : int
        Number of buckets, a power of two.
    """
    return ((cell_x * X_PRIME) ^ (cell_y * Y_PRIME)) & (buckets - 1)


@kernel
def add_to_map(
    buckets: Records[Bucket], cell_m: float, x: float, y: float, nx: float, ny: float, number: int, time_s: float
) -> int:
    """Put a segment into its cell's bucket; return the bucket's index.

    A full bucket forgets its oldest segment. A bucket that another cell holds is emptied and taken over.

    Parameters
    ----------
    buckets : (n,) Bucket
        The map, updated; n is a power of two.
    cell_m : float
        Side of a cell, m.
    x, y, nx, ny : float
        The segment's middle (m) and unit normal.
    number, time_s
        Its number and the time of its firing, s.
    """
    cell_x = math.floor(x / cell_m)
    cell_y = math.floor(y / cell_m)
    k = bucket_index(cell_x, cell_y, len(buckets))
    bucket = buckets[k]
    if bucket.cell_x != cell_x or bucket.cell_y != cell_y:
        bucket.cell_x = cell_x
        bucket.cell_y = cell_y
        bucket.count = 0
    segment = bucket.segments[bucket.count % BUCKET_CAPACITY]
    segment.x = x
    segment.y = y
    segment.normal_x = nx
    segment.normal_y = ny
    segment.number = number
    segment.time_s = time_s
    bucket.count += 1
    return k


@kernel
def segments_near(
    buckets: Records[Bucket], cell_m: float, x: float, y: float, radius: float, found: Records[MappedSegment]
) -> int:
    """Copy the places and normals of the segments whose middles lie within a circle; return how many.

    Parameters
    ----------
    buckets, cell_m
        As for `add_to_map`.
    x, y, radius : float
        The circle, m.
    found : (m,) MappedSegment
        Out: middle and normal. What does not fit is left out.
    """
    n = 0
    for cell_x in range(math.floor((x - radius) / cell_m), math.floor((x + radius) / cell_m) + 1):
        for cell_y in range(math.floor((y - radius) / cell_m), math.floor((y + radius) / cell_m) + 1):
            bucket = buckets[bucket_index(cell_x, cell_y, len(buckets))]
            if bucket.cell_x != cell_x or bucket.cell_y != cell_y:
                continue
            for j in range(min(bucket.count, BUCKET_CAPACITY)):
                if n >= len(found):
                    return n
                segment = bucket.segments[j]
                if (segment.x - x) ** 2 + (segment.y - y) ** 2 < radius * radius:
                    out = found[n]
                    out.x = segment.x
                    out.y = segment.y
                    out.normal_x = segment.normal_x
                    out.normal_y = segment.normal_y
                    n += 1
    return n
