"""The way as known now, as clients see it: encoded when it has changed, and no longer than a page can show."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import orjson

from drivers.messages import Floats
from perception.localization.localized_pose import KnownWay
from runtime.console.frames.state_message import WayRow

ROWS_MAX: Final = 1000
"""Most places, maps, and loop closures of a way, about: a message of 60 kB. Of more every second or third is sent."""
PLACES: Final = 3
"""Decimals of a place: millimetres; a variance has twice as many."""
NOWHERE: Final = b'{"path":[],"maps":[],"loops":[]}'


class KnownWayRow:
    """The way as the last frame had it.

    Attributes
    ----------
    json : bytes
        All of it.
    """

    def __init__(self) -> None:
        self._way: KnownWay | None = None
        self.json = NOWHERE

    def update(self, way: KnownWay | None) -> bool:
        """Take the way as it is now and return whether it differs; the same object costs nothing."""
        if way is self._way:
            return False
        self._way = way
        self.json = NOWHERE if way is None else orjson.dumps(_row(way))
        return True


def _row(way: KnownWay) -> WayRow:
    maps = _fewer(way.maps)
    places, spreads = np.round(maps[:, :2], PLACES), np.round(maps[:, 2:], 2 * PLACES)
    return {
        "path": np.round(_fewer(way.path), PLACES).tolist(),
        "maps": np.column_stack([places, spreads]).tolist(),
        "loops": np.round(_fewer(way.loops), PLACES).tolist(),
    }


def _fewer(rows: Floats) -> Floats:
    """Return evenly spaced ones of some rows, the last among them."""
    return rows[:: -max(1, math.ceil(len(rows) / ROWS_MAX))][::-1]
