"""Where what perception remembers of each map of the way stands: in the filter's frame, moved as poses are corrected.

What was recognised along a map was entered at the poses of then. When matches correct the poses of the maps, what is
remembered of each moves with it. The filter's frame is chosen so that the maps driven last, among which the robot is,
move as little as possible: what is near stays where it is, and what lies behind comes into its place.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from perception.bounds import PLACE, bounds
from perception.kernel import Floats
from perception.localization.submaps.submap_records import compose
from perception.map_moves import MapMoves

HELD_MOVED_M: Final = 0.025
"""What has moved by less stays in its cells of 0.05 m."""
HELD_REACH_M: Final = 3.0
"""From the way to what answers: as far as a turn moves it."""
NEAR_WAY_M: Final = 25.0
"""Way of the readings by which the method knows what is near: for it a map counts by exp(−way since then / this)."""


class HeldMaps:
    """Where each map stands in the filter's frame, as what is remembered of it does.

    Attributes
    ----------
    archived_rows : (n, 3) float
        x, y (m) and direction (rad, not wrapped) of each map; by odometry until poses are corrected.
    is_moved : bool
        Whether the filter's frame is no longer odometry's.
    """

    BOUNDS: Final = bounds(archived_rows=PLACE, _from_map=PLACE)

    def __init__(self) -> None:
        self._from_map = np.zeros(3)
        """The map frame in the filter's, x, y (m) and direction (rad)."""
        self.reset()

    def reset(self) -> None:
        """Start again without maps, in odometry's frame."""
        self.archived_rows: Floats = np.zeros((0, 3))
        self._from_map[:] = 0.0
        self.is_moved = False

    def append(self, pose: Floats) -> None:
        """Add a map at a pose of odometry's frame, or once poses are corrected, of the map frame."""
        self.archived_rows = np.vstack([self.archived_rows, self.in_filter(pose)])

    def in_filter(self, pose: Floats) -> Floats:
        """Return a pose of the map frame in the filter's frame, shape (3,)."""
        return compose(self._from_map, pose)

    def move_to(self, poses: Floats, way: Floats) -> MapMoves | None:
        """Bring the maps to their poses as known now; return the motions, None where none is worth it.

        Parameters
        ----------
        poses : (n, 3) float
            Of the maps in the map frame, x, y (m) and direction (rad), not wrapped.
        way : (n,) float
            Until each of them, m.
        """
        held, weights = self.archived_rows, np.exp((way - way[-1]) / NEAR_WAY_M)
        weights /= weights.sum()
        turn = float(weights @ (held[:, 2] - poses[:, 2]))
        c, s = math.cos(turn), math.sin(turn)
        stand = poses @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + (0.0, 0.0, turn)
        shift = weights @ (held - stand)[:, :2]
        stand[:, :2] += shift
        x, y, turns = (stand - held).T
        if not (np.hypot(x, y) + HELD_REACH_M * np.abs(turns) > HELD_MOVED_M).any():
            return None
        is_first = not self.is_moved
        self.archived_rows, self.is_moved = stand, True
        self._from_map[:] = *shift, turn
        c, s = np.cos(turns), np.sin(turns)
        to_x = stand[:, 0] - c * held[:, 0] + s * held[:, 1]
        to_y = stand[:, 1] - s * held[:, 0] - c * held[:, 1]
        return MapMoves(np.column_stack([to_x, to_y, turns]), held[:, :2], is_first)
