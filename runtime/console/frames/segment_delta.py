"""The outline segments as clients see them: what is new and what is gone since the last frame, or all of them.

Hundreds of segments change by a few in a cycle. So a client that got every frame gets the changes only, and one that
has missed any, or has just come, gets the whole; both are encoded once for all who need them.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import orjson

from drivers.messages import Floats
from perception.kernel import Ints

PLACES: Final = 4
"""Tenths of a millimetre."""


def _encoded(numbers: Ints, rows: Floats) -> bytes:
    values = np.round(rows, PLACES).tolist()
    return orjson.dumps([[number, *row] for number, row in zip(numbers.tolist(), values, strict=True)])


class SegmentTable:
    """What the last frame showed."""

    def __init__(self) -> None:
        self._numbers: Ints = np.zeros(0, dtype=np.int64)
        self._rows: Floats = np.zeros((0, 6))
        self._there: set[int] = set()
        self._pinned = b"[]"
        self._whole: bytes | None = None

    def update(self, numbers: Ints, rows: Floats, pinned: Ints) -> bytes:
        """Take what the map holds now and return what is other than before, as JSON.

        Parameters
        ----------
        numbers : (n,) int
            Of the segments; one that stays keeps its number, and none is used twice.
        rows : (n, 6) float
            Ends x, y, x, y (m), normal (rad), when it was completed (robot's time, s).
        pinned : (k,) int
            Numbers of those that are pinned.
        """
        now = numbers.tolist()
        before, there = self._there, set(now)
        added = [k for k, number in enumerate(now) if number not in before]
        self._numbers, self._rows, self._there, self._whole = numbers, rows, there, None
        self._pinned = orjson.dumps(pinned.tolist())
        return self._changes(_encoded(numbers[added], rows[added]), orjson.dumps(sorted(before - there)))

    def unchanged(self) -> bytes:
        """Return that nothing is other than before."""
        return self._changes(b"[]", b"[]")

    def whole(self) -> bytes:
        """Return all that the last frame showed, as JSON."""
        if self._whole is None:
            self._whole = b'{"added":%b,"removed":[],"pinned":%b,"whole":true}' % (
                _encoded(self._numbers, self._rows), self._pinned
            )  # fmt: skip
        return self._whole

    def _changes(self, added: bytes, removed: bytes) -> bytes:
        return b'{"added":%b,"removed":%b,"pinned":%b,"whole":false}' % (added, removed, self._pinned)
