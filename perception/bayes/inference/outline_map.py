"""The outline map as hypotheses use it: the segments near a place, and the relaxation of a body onto them.

The map is a hashed grid of small buckets: a cell's newest segments push out its oldest, and another cell of the same
hash takes a bucket over. Its size and the cost of a look-up do not grow with the mission, and what has gone is
overwritten by what is seen instead.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.memory.elements import BUCKET_CAPACITY, MappedSegment
from perception.bayes.memory.parameters import RELAXATION_GAMMA
from perception.bayes.memory.state import Bucket, StateRecord
from perception.kernel import Floats, kernel
from perception.records import Records
from perception.relaxation import relax

X_PRIME: Final = 73856093
"""Factor of a cell's column in the spatial hash of Teschner et al., Optimized Spatial Hashing (VMV 2003), §3."""
Y_PRIME: Final = 19349663
"""Factor of a cell's row in the same hash."""


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


@kernel
def enter_attracting(segment: MappedSegment, row: Floats) -> None:
    """Write a mapped segment as the relaxation takes it, (5,) float: it has a middle and a normal, and no ends."""
    row[0] = segment.x
    row[1] = segment.y
    row[2] = segment.x
    row[3] = segment.y
    row[4] = math.atan2(segment.normal_y, segment.normal_x)


@kernel
def set_hypothesis(s: StateRecord, x: float, y: float, heading: float) -> None:
    """Set the scratch's hypothesis to a pose.

    Parameters
    ----------
    s : (1,) State
        Memory; its scratch is updated.
    x, y, heading : float
        The pose, m, rad.
    """
    hypothesis = s[0].scratch.hypothesis
    hypothesis.x = x
    hypothesis.y = y
    hypothesis.heading = heading


@kernel
def relax_hypothesis(
    s: StateRecord, sides: Floats, attracting: int, negligible_m: float, negligible_rad: float, steps: int
) -> None:
    """Move the scratch's hypothesis by the paper's relaxation (§3.4).

    Parameters
    ----------
    s : (1,) State
        Memory, updated.
    sides : (n, 4) float
        The model's sides, as `perception.relaxation` takes them.
    attracting : int
        How many of the scratch's attracting segments there are.
    negligible_m, negligible_rad, steps
        As for `perception.relaxation.relax`.
    """
    scratch = s[0].scratch
    hypothesis = scratch.hypothesis
    pose = scratch.pose[:]
    pose[0] = hypothesis.x
    pose[1] = hypothesis.y
    pose[2] = hypothesis.heading
    relax(
        sides,
        scratch.attracting[:],
        scratch.attracting_rows[:attracting],
        RELAXATION_GAMMA,
        negligible_m,
        negligible_rad,
        steps,
        pose,
    )
    hypothesis.x = pose[0]
    hypothesis.y = pose[1]
    hypothesis.heading = pose[2]
