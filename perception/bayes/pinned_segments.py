"""Pinned segments of the Bayesian method's outline map, and segments taken out of it.

The map forgets by being written over: a cell's newest segments push out its oldest, and a bucket whose hash another
cell wants changes hands. So what is pinned is kept beside the map as well, and put in again whenever it has gone. Not
all of a bucket may be pinned; the rest goes on as ever.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

import numpy as np

from perception.bayes.segment_pairs import map_add
from perception.bayes.state import STAMP, State
from perception.bayes.track_initiation import CELL_M
from perception.kernel import Floats, Ints

ROOM: Final = 512
"""Segments pinned at a time."""
FREE_PLACES: Final = 2
"""So many of a bucket are never pinned."""


class Pins:
    """What is pinned: a copy of each segment."""

    def __init__(self) -> None:
        self.rows = np.zeros((ROOM, 4))
        """(ROOM, 4): middle x, y (m) and unit normal; the first `count` are valid."""
        self.stamps = np.zeros((ROOM, 2))
        """(ROOM, 2): number and time, as in `State.stamps`."""
        self.buckets = np.zeros(ROOM, np.int64)
        self.count = 0

    @property
    def numbers(self) -> Floats:
        """The pinned segments' numbers."""
        return self.stamps[: self.count, STAMP]

    def renew(self, s: State) -> None:
        """Put into the map what has gone from it."""
        buckets = self.buckets[: self.count]
        held = np.arange(s.store.shape[1]) < s.fill[buckets, None]
        is_there = (held & (s.stamps[buckets, :, STAMP] == self.numbers[:, None])).any(axis=1)
        for k in np.flatnonzero(~is_there):
            bucket = map_add(self.rows[k], CELL_M, s.tags, s.fill, s.store)
            s.stamps[bucket, (s.fill[bucket] - 1) % s.store.shape[1]] = self.stamps[k]

    def add(self, s: State, numbers: Collection[int]) -> tuple[set[int], set[int]]:
        """Pin segments; return the numbers that are not in the map, and those for which there is no room."""
        found = where(s, numbers).tolist()
        there = {int(s.stamps[k, j, STAMP]) for k, j in found}
        held, full = set(self.numbers.astype(np.int64).tolist()), set[int]()
        for bucket, j in found:
            number = int(s.stamps[bucket, j, STAMP])
            if number in held:
                continue
            if self.count == ROOM or not self._has_room(s, bucket, s.store[bucket, j]):
                full.add(number)
                continue
            self.rows[self.count] = s.store[bucket, j]
            self.stamps[self.count] = s.stamps[bucket, j]
            self.buckets[self.count] = bucket
            self.count += 1
        return set(numbers) - there, full

    def remove(self, numbers: Collection[int]) -> set[int]:
        """Let segments go; return the numbers that were not pinned."""
        stays = ~np.isin(self.numbers, np.array(sorted(numbers), np.float64))
        missing = set(numbers) - set(self.numbers[~stays].astype(np.int64).tolist())
        left = int(np.count_nonzero(stays))
        for array in (self.rows, self.stamps, self.buckets):
            array[:left] = array[: self.count][stays]
            array[left:] = 0
        self.count = left
        return missing

    def clear(self) -> None:
        """Let all go."""
        self.rows[:], self.stamps[:], self.buckets[:] = 0.0, 0.0, 0
        self.count = 0

    def _has_room(self, s: State, bucket: int, row: Floats) -> bool:
        """Tell whether another segment can be pinned in a bucket: not the last two, and of one cell only."""
        others = self.rows[: self.count][self.buckets[: self.count] == bucket]
        same = np.floor(others[:, :2] / CELL_M) == np.floor(row[:2] / CELL_M)
        return len(others) < s.store.shape[1] - FREE_PLACES and bool(same.all())


def where(s: State, numbers: Collection[int]) -> Ints:
    """Return the places in the map of the segments of these numbers: bucket and which in it, shape (n, 2)."""
    places = np.argwhere(np.arange(s.store.shape[1]) < s.fill[:, None])
    wanted = np.array(sorted(numbers), np.float64)
    return places[np.isin(s.stamps[places[:, 0], places[:, 1], STAMP], wanted)]


def delete(s: State, pins: Pins, numbers: Collection[int]) -> set[int]:
    """Take segments out of the map; return the numbers that are not there."""
    doomed = where(s, numbers)
    gone = set(s.stamps[doomed[:, 0], doomed[:, 1], STAMP].astype(np.int64).tolist())
    capacity = s.store.shape[1]
    for k in np.unique(doomed[:, 0]).tolist():
        held = min(int(s.fill[k]), capacity)
        oldest_first = (int(s.fill[k]) - held + np.arange(held)) % capacity
        left = oldest_first[~np.isin(oldest_first, doomed[doomed[:, 0] == k, 1])]
        for array in (s.store, s.stamps):
            array[k, : len(left)] = array[k, left]
        s.fill[k] = len(left)
    pins.remove(gone)
    return set(numbers) - gone
