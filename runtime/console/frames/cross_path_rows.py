"""Cross paths as clients see them: what listeners heard since the last frame, from where the ring then was."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

import numpy as np

from drivers.messages import Firing
from runtime.console.frames.state_message import CrossPathRow

PATHS_MAX: Final = 64
"""Most cross paths in a frame, the newest. Between two frames a ring with 16 listeners fires twice."""
FIRINGS_MAX: Final = 8
"""Firings kept for the next frame."""
PLACES: Final = 4
"""Decimals: tenths of a millimetre, and of a milliradian."""


class CrossPathRows:
    """The cross paths since the last frame."""

    def __init__(self) -> None:
        self._firings: deque[Firing] = deque(maxlen=FIRINGS_MAX)

    def take(self, firing: Firing) -> None:
        """Keep a firing for the next frame, if any sensor listened in it."""
        if firing.cross_paths is not None:
            self._firings.append(firing)

    def clear(self) -> None:
        """Forget what is kept."""
        self._firings.clear()

    def rows(self) -> list[CrossPathRow]:
        """Return the firings kept, oldest first, with the paths that were heard, and keep them no longer.

        Each has `robot_s`, the ring's `pose` (x, y, heading, ring's yaw; m and rad), and `paths`: transmitter,
        listener, half the path in m.
        """
        left = PATHS_MAX
        found: list[CrossPathRow] = []
        while self._firings:
            firing = self._firings.pop()
            paths = _heard(firing)[:left]
            left -= len(paths)
            if paths:
                at = firing.pose
                x, y, heading, yaw = (round(value, PLACES) for value in (at.x, at.y, at.theta, firing.ring_yaw))
                found.append({"robot_s": round(firing.robot_s, 3), "pose": (x, y, heading, yaw), "paths": paths})
        return found[::-1]


def _heard(firing: Firing) -> list[tuple[int, int, float]]:
    """Return transmitter, listener and half path (m) of each cross path that was heard."""
    crosses = firing.cross_paths
    if crosses is None:
        return []
    columns = (crosses.transmitters, crosses.listeners, np.round(crosses.half_paths_m, PLACES))
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return [row for row in rows if row[2] < math.inf]
