"""The outline map: how a segment gets into it, how many it holds, and copies of its segments for display."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from perception.bayes.inference.outline_map import add_to_map, bucket_index
from perception.bayes.memory.elements import BUCKET_CAPACITY, MappedSegment
from perception.bayes.memory.parameters import OUTLINE_CELL_M
from perception.bayes.memory.state import FREE, CircleTracks, Memory, StateRecord
from perception.kernel import Floats, kernel
from perception.records import Records, Structured, records, zeros

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
        As for `outline_map.add_to_map`.
    """
    buckets = s[0].buckets
    k = bucket_index(math.floor(x / OUTLINE_CELL_M), math.floor(y / OUTLINE_CELL_M), len(buckets))
    bucket = buckets[k]
    before = min(bucket.count, BUCKET_CAPACITY)
    if before == 0:
        used = s[0].used_buckets
        at = s[0].buckets_used
        while at > 0 and used[at - 1] > k:
            used[at] = used[at - 1]
            at -= 1
        used[at] = k
        s[0].buckets_used += 1
    add_to_map(buckets, OUTLINE_CELL_M, x, y, nx, ny, number, time_s)
    s[0].segments_held += min(bucket.count, BUCKET_CAPACITY) - before


def count_again(memory: Memory) -> None:
    """Count the segments and the used buckets of the map, after others than `put_segment` changed it."""
    counts, used_buckets = memory.state["buckets"][0]["count"], memory.state["used_buckets"][0]
    used = np.flatnonzero(counts)
    memory.state["segments_held"] = np.minimum(counts, BUCKET_CAPACITY).sum()
    memory.state["buckets_used"] = len(used)
    used_buckets[: len(used)], used_buckets[len(used) :] = used, 0


@kernel
def count_map(s: StateRecord, tracks: CircleTracks) -> tuple[int, int, int]:
    """Return the number of segments in the map, of those made since the start, and of tracks, tentative ones too."""
    held = 0
    for t in range(len(tracks)):
        held += tracks[t].status != FREE
    for t in range(len(s[0].polygons)):
        held += s[0].polygons[t].status != FREE
    return s[0].segments_held, s[0].segments_made, held


@kernel
def copy_segments(s: StateRecord, out: Records[MappedSegment]) -> None:
    """Copy the segments in the map, bucket by bucket.

    Parameters
    ----------
    s : (1,) State
        Memory.
    out : (n,) MappedSegment
        Out; as many as the map holds.
    """
    n = 0
    for i in range(s[0].buckets_used):
        bucket = s[0].buckets[s[0].used_buckets[i]]
        for j in range(min(bucket.count, BUCKET_CAPACITY)):
            segment = bucket.segments[j]
            copied = out[n]
            copied.x = segment.x
            copied.y = segment.y
            copied.normal_x = segment.normal_x
            copied.normal_y = segment.normal_y
            copied.number = segment.number
            copied.time_s = segment.time_s
            n += 1


def mapped_segments(memory: Memory) -> Structured:
    """Return the segments in the map as records of `state.MappedSegment`, shape (n,), a copy."""
    segments = zeros(MappedSegment, memory.state["segments_held"].item())
    copy_segments(memory.s, records(MappedSegment, segments))
    return segments


def drawn(segments: Structured) -> Floats:
    """Return ends x, y, x, y (m) and normal (rad), shape (n, 5), of mapped segments, shape (n,)."""
    ends = np.empty((len(segments), 5))
    x, y, nx, ny = (segments[name] for name in ("x", "y", "normal_x", "normal_y"))
    along_x, along_y = -0.5 * SHOWN_M * ny, 0.5 * SHOWN_M * nx
    ends[:, 0], ends[:, 1] = x - along_x, y - along_y
    ends[:, 2], ends[:, 3] = x + along_x, y + along_y
    np.arctan2(ny, nx, out=ends[:, 4])
    return ends
