"""The outline map: how a segment gets into it, how many it holds, and copies of its segments for display."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.bayes.elements import BUCKET_CAPACITY
from perception.bayes.parameters import CELL_M
from perception.bayes.segment_pairs import add_to_map, bucket_index
from perception.bayes.state import FREE, CircleTracks, Memory, StateRecord
from perception.kernel import Floats, kernel

SHOWN_M: Final = 0.1
"""Length at which a mapped segment is shown; the map keeps its middle and normal."""


@kernel
def put_segment(s: StateRecord, x: float, y: float, nx: float, ny: float, number: int, time_s: float) -> None:
    """Put a segment into the outline map.

    Parameters
    ----------
    s : (1,) State
        Memory, updated.
    x, y, nx, ny, number, time_s
        As for `segment_pairs.add_to_map`.
    """
    buckets = s[0].buckets
    bucket = buckets[bucket_index(math.floor(x / CELL_M), math.floor(y / CELL_M), len(buckets))]
    before = min(bucket.count, BUCKET_CAPACITY)
    add_to_map(buckets, CELL_M, x, y, nx, ny, number, time_s)
    s[0].segments_held += min(bucket.count, BUCKET_CAPACITY) - before


def count_again(memory: Memory) -> None:
    """Count the segments in the map, after others than `put_segment` changed it."""
    memory.state["segments_held"] = np.minimum(memory.state["buckets"][0]["count"], BUCKET_CAPACITY).sum()


@kernel
def count_map(s: StateRecord, tracks: CircleTracks) -> tuple[int, int, int]:
    """Return the number of segments in the map, of those made since the start, and of tracks, tentative ones too."""
    held = 0
    for t in range(len(tracks)):
        held += tracks[t].status != FREE
    for t in range(len(s[0].polygons)):
        held += s[0].polygons[t].status != FREE
    return s[0].segments_held, s[0].segments_made, held


def mapped_segments(memory: Memory) -> NDArray[Any]:
    """Return the segments in the map as records of `state.MappedSegment`, shape (n,), a copy."""
    # Of thousands of buckets a hundred are in use, and this is called between two cycles.
    buckets = memory.state["buckets"][0]
    counts = buckets["count"]
    used = np.flatnonzero(counts)
    held = np.arange(BUCKET_CAPACITY) < counts[used, None]
    return buckets["segments"][used][held]  # type: ignore[no-any-return]  # numpy types a field as Any


def drawn(segments: NDArray[Any]) -> Floats:
    """Return ends x, y, x, y (m) and normal (rad), shape (n, 5), of mapped segments, shape (n,)."""
    ends = np.empty((len(segments), 5))
    x, y, nx, ny = (segments[name] for name in ("x", "y", "normal_x", "normal_y"))
    along_x, along_y = -0.5 * SHOWN_M * ny, 0.5 * SHOWN_M * nx
    ends[:, 0], ends[:, 1] = x - along_x, y - along_y
    ends[:, 2], ends[:, 3] = x + along_x, y + along_y
    np.arctan2(ny, nx, out=ends[:, 4])
    return ends
