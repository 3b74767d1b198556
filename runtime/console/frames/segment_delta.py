"""The outline segments as clients see them: what was added and removed since the last frame, or all of them.

Of hundreds of segments a few change in a cycle. A client that got every frame gets the changes only; one that missed
a frame or has just joined gets all segments. Both are encoded once for all clients that need them.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import orjson

from drivers.messages import Floats
from perception.kernel import Ints

PLACES: Final = 4
"""Decimals of coordinates: tenths of a millimetre."""
COLUMNS: Final = 6
"""Of a row: end points x1, y1, x2, y2, direction of the normal, time of completion."""


class SegmentDelta:
    """The segments of the last frame, and their changes from frame to frame."""

    def __init__(self) -> None:
        self._numbers: Ints = np.zeros(0, dtype=np.int64)
        self._rows: Floats = np.zeros((0, COLUMNS))
        self._shown: set[int] = set()
        """The numbers, as a set."""
        self._pinned = b"[]"
        """Numbers of the pinned ones, JSON."""
        self._whole: bytes | None = None
        """What `whole` returns; None until it is asked for."""

    def update(self, numbers: Ints, rows: Floats, pinned: Ints) -> bytes:
        """Replace the segments and return what changed, as JSON.

        Parameters
        ----------
        numbers : (n,) int
            Of the segments; a segment keeps its number, and no number is used twice.
        rows : (n, 6) float
            End points x1, y1, x2, y2 (m), direction of the normal (rad), time of completion (robot's clock, s).
        pinned : (k,) int
            Numbers of the pinned segments.
        """
        current = numbers.tolist()
        before, shown = self._shown, set(current)
        added = [k for k, number in enumerate(current) if number not in before]
        self._numbers, self._rows, self._shown, self._whole = numbers, rows, shown, None
        self._pinned = orjson.dumps(pinned.tolist())
        return self._changes(_encode_rows(numbers[added], rows[added]), orjson.dumps(sorted(before - shown)))

    def unchanged(self) -> bytes:
        """Return the JSON of no change."""
        return self._changes(b"[]", b"[]")

    def whole(self) -> bytes:
        """Return all segments of the last frame as JSON."""
        if self._whole is None:
            self._whole = b'{"added":%b,"removed":[],"pinned":%b,"whole":true}' % (
                _encode_rows(self._numbers, self._rows),
                self._pinned,
            )
        return self._whole

    def _changes(self, added: bytes, removed: bytes) -> bytes:
        return b'{"added":%b,"removed":%b,"pinned":%b,"whole":false}' % (added, removed, self._pinned)


def _encode_rows(numbers: Ints, rows: Floats) -> bytes:
    values = np.round(rows, PLACES).tolist()
    return orjson.dumps([[number, *row] for number, row in zip(numbers.tolist(), values, strict=True)])
