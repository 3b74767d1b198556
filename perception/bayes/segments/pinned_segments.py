"""Pinned segments of the outline map, and deletion of segments from it.

The map forgets by overwriting: a cell's newest segments replace its oldest, and another cell of the same hash takes
a bucket over. So pinned segments are also kept separately, and are restored when they were overwritten. A few places
of each bucket are never pinned, so that the map can still take new segments.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from operator import itemgetter
from typing import Any, Final

import numpy as np

from perception.bayes.memory.elements import BUCKET_CAPACITY, BUCKETS, MappedSegment
from perception.bayes.memory.parameters import OUTLINE_CELL_M
from perception.bayes.memory.state import Memory
from perception.bayes.segments.segment_list import count_again, mapped_segments, put_segment
from perception.bounds import bounds, index_of, up_to
from perception.kernel import Ints
from perception.records import Structured, zeros

PINS_MAX: Final = 512
"""Greatest number of pinned segments."""
UNPINNED_MIN: Final = 2
"""Places of a bucket that are never pinned."""


class Pins:
    """The pinned segments: a copy of each."""

    BOUNDS: Final = bounds(segments=MappedSegment.BOUNDS, buckets=index_of(BUCKETS), count=up_to(PINS_MAX))

    def __init__(self) -> None:
        self.segments = zeros(MappedSegment, PINS_MAX)
        """The first `count` are valid."""
        self.buckets = np.zeros(PINS_MAX, np.int64)
        """Index of the bucket of each."""
        self.count = 0

    @property
    def numbers(self) -> Ints:
        """The pinned segments' numbers."""
        numbers: Ints = self.segments["number"][: self.count]
        return numbers

    def renew(self, memory: Memory) -> None:
        """Restore the pinned segments that were overwritten in the map."""
        buckets = memory.state["buckets"][0][self.buckets[: self.count]]
        held = np.arange(BUCKET_CAPACITY) < buckets["count"][:, None]
        is_there = (held & (buckets["segments"]["number"] == self.numbers[:, None])).any(axis=1)
        for k in np.flatnonzero(~is_there):
            put_segment(memory.s, *self.segments[k].item())

    def add(self, memory: Memory, numbers: Collection[int]) -> tuple[set[int], set[int]]:
        """Pin segments; return the numbers that are not in the map, and those that do not fit."""
        buckets = memory.state["buckets"][0]
        found = places_of(memory, numbers).tolist()
        there = {int(buckets["segments"]["number"][k, j]) for k, j in found}
        held, full = set(self.numbers.tolist()), set[int]()
        for bucket, j in found:
            segment = buckets["segments"][bucket, j]
            number = int(segment["number"])
            if number in held:
                continue
            if self.count == PINS_MAX or not self._has_room(bucket, segment):
                full.add(number)
                continue
            self.segments[self.count] = segment
            self.buckets[self.count] = bucket
            self.count += 1
        return set(numbers) - there, full

    def remove(self, numbers: Collection[int]) -> set[int]:
        """Release segments; return the numbers that were not pinned."""
        stays = ~np.isin(self.numbers, np.array(sorted(numbers), np.int64))
        missing = set(numbers) - set(self.numbers[~stays].tolist())
        left = int(np.count_nonzero(stays))
        for array in (self.segments, self.buckets):
            array[:left] = array[: self.count][stays]
            array[left:] = np.zeros((), array.dtype)
        self.count = left
        return missing

    def clear(self) -> None:
        """Release all segments."""
        self.segments[:], self.buckets[:] = np.zeros((), self.segments.dtype), 0
        self.count = 0

    def _has_room(self, bucket: int, segment: Any) -> bool:  # noqa: ANN401 - numpy's record
        """Return whether another segment can be pinned in a bucket: not the last two, and of one cell only."""
        others = self.segments[: self.count][self.buckets[: self.count] == bucket]
        is_same = (np.floor(others["x"] / OUTLINE_CELL_M) == np.floor(segment["x"] / OUTLINE_CELL_M)) & (
            np.floor(others["y"] / OUTLINE_CELL_M) == np.floor(segment["y"] / OUTLINE_CELL_M)
        )
        return len(others) < BUCKET_CAPACITY - UNPINNED_MIN and bool(is_same.all())


def places_of(memory: Memory, numbers: Collection[int]) -> Ints:
    """Return bucket and place in the bucket of the segments of these numbers, shape (n, 2)."""
    buckets: Structured = memory.state["buckets"][0]
    places = np.argwhere(np.arange(BUCKET_CAPACITY) < buckets["count"][:, None])
    wanted = np.array(sorted(numbers), np.int64)
    return places[np.isin(buckets["segments"]["number"][places[:, 0], places[:, 1]], wanted)]


def delete(memory: Memory, pins: Pins, numbers: Collection[int]) -> set[int]:
    """Delete segments from the map; return the numbers that are not in it.

    Parameters
    ----------
    memory, pins
        Updated.
    numbers : collection of int
        The segments' numbers.
    """
    buckets = memory.state["buckets"][0]
    deleted = places_of(memory, numbers)
    gone = set(buckets["segments"]["number"][deleted[:, 0], deleted[:, 1]].tolist())
    for k in np.unique(deleted[:, 0]).tolist():
        count = int(buckets["count"][k])
        held = min(count, BUCKET_CAPACITY)
        oldest_first = (count - held + np.arange(held)) % BUCKET_CAPACITY
        left = oldest_first[~np.isin(oldest_first, deleted[deleted[:, 0] == k, 1])]
        segments = buckets["segments"][k]
        segments[: len(left)] = segments[left]
        buckets["count"][k] = len(left)
    count_again(memory)
    pins.remove(gone)
    return set(numbers) - gone


def restore(memory: Memory, pins: Pins, rows: Sequence[Sequence[float]]) -> str | None:
    """Put deleted segments back; return None, or why some were left out.

    Those that are in the map are left as they are. Where a bucket has filled since, the oldest of it give way.

    Parameters
    ----------
    memory, pins
        Updated.
    rows : sequence of sequence of float
        As of `edits.RestoreSegments`; finite.
    """
    never = [row[0] for row in rows if row[0] > int(memory.state["segments_numbered"][0])]
    if never:
        return f"no segment ever had the number {never[0]:.0f}"
    numbers = {int(row[0]) for row in rows}
    present = {int(n) for n in mapped_segments(memory)["number"] if int(n) in numbers}
    for number, x1, y1, x2, y2, normal, time_s, _ in sorted(rows, key=itemgetter(0)):
        if int(number) not in present:
            put_segment(
                memory.s, 0.5 * (x1 + x2), 0.5 * (y1 + y2), math.cos(normal), math.sin(normal), int(number), time_s
            )
    _, full = pins.add(memory, [int(row[0]) for row in rows if row[7] == 1.0])
    return f"{len(full)} segments are back, but too many are pinned to pin them again" if full else None
