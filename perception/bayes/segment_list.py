"""The outline map for display: copies of its segments in the order of its buckets, and how much the memory holds."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.bayes.elements import BUCKET_CAPACITY
from perception.bayes.state import FREE, CircleTracks, Memory, StateRecord
from perception.kernel import Floats, kernel

SHOWN_M: Final = 0.1
"""Length at which a mapped segment is shown; the map keeps its middle and normal."""


@kernel
def count_segments(s: StateRecord) -> int:
    """Return the number of segments in the map; it looks at every bucket, 40 µs on a slow machine."""
    segments = 0
    for b in range(len(s[0].buckets)):
        segments += min(s[0].buckets[b].count, BUCKET_CAPACITY)
    return segments


@kernel
def count_made(s: StateRecord, tracks: CircleTracks) -> tuple[int, int]:
    """Return the number of segments made since the start, and of tracks, tentative ones included."""
    held = 0
    for t in range(len(tracks)):
        held += tracks[t].status != FREE
    for t in range(len(s[0].polygons)):
        held += s[0].polygons[t].status != FREE
    return s[0].segments_made, held


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
