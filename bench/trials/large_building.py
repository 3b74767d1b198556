"""A building of square rooms with doorways and drums, as large as one likes, and a drive through some of its rooms.

The walls between rooms stand a little off their grid and have a doorway each, so that no two rooms are alike.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from bench.trials.furnished_rooms import ACOUSTICS
from config.world import AcousticsConfig, DrumConfig, WallConfig, WorldConfig
from drivers.messages import Floats

ROOM_M: Final = 8.0
"""Distance between the walls of a room, …"""
MOVED_M: Final = 0.6
"""… each of which stands so far off at most, as a whole."""
DOORWAY_M: Final = (1.1, 1.6)
DOORWAY_OFF_M: Final = 2.0
"""Width of a doorway, and its greatest distance from the middle of the wall."""
DRUM_AT_M: Final = (2.2, 2.8)
"""Distance of a drum from the middle of its room along both axes: beside all ways between doorways."""
DRUM_RADIUS_M: Final = 0.3


class Building:
    """A building and its doorways.

    Parameters
    ----------
    seed : int
        Which building.
    side_m : float
        Its length and width; whole rooms fit in.
    acoustics : AcousticsConfig
        By default specular, with 1 % noise, 3 % outliers and 5 % drop-outs.

    Attributes
    ----------
    rooms : int
        Rooms along each side.
    world : WorldConfig
        Walls and drums.
    """

    def __init__(self, seed: int, side_m: float, acoustics: AcousticsConfig = ACOUSTICS) -> None:
        rng = np.random.default_rng(np.random.SeedSequence([seed, 22]))
        n = self.rooms = max(2, int(side_m / ROOM_M))
        lines = np.arange(n + 1) * ROOM_M
        self._at = lines + rng.uniform(-MOVED_M, MOVED_M, (2, n + 1))
        """Where the walls across x and those across y stand."""
        self._offsets = rng.uniform(-DOORWAY_OFF_M, DOORWAY_OFF_M, (2, n + 1, n))
        widths = rng.uniform(*DOORWAY_M, (2, n + 1, n))
        walls: list[WallConfig] = []
        for axis in range(2):
            across = self._at[1 - axis]
            for k in range(n + 1):
                for j in range(n):
                    cuts = [across[j], across[j + 1]]
                    if 0 < k < n:
                        middle, half = 0.5 * (cuts[0] + cuts[1]) + self._offsets[axis, k, j], 0.5 * widths[axis, k, j]
                        cuts[1:1] = [middle - half, middle + half]
                    for low, high in zip(cuts[::2], cuts[1::2], strict=True):
                        ends = np.array([[self._at[axis, k], low], [self._at[axis, k], high]])[:, :: 1 - 2 * axis]
                        (x1, y1), (x2, y2) = ends.tolist()
                        walls.append(WallConfig(x1_m=x1, y1_m=y1, x2_m=x2, y2_m=y2))
        drums = []
        for row in range(n):
            for column in range(n):
                x, y = self.middle(column, row) + rng.choice([-1.0, 1.0], 2) * rng.uniform(*DRUM_AT_M, 2)
                drums.append(DrumConfig(x_m=float(x), y_m=float(y), radius_m=DRUM_RADIUS_M))
        self.world = WorldConfig(wall=tuple(walls), drum=tuple(drums), acoustics=acoustics)

    def middle(self, column: int, row: int) -> Floats:
        """Return the middle of a room, x and y in m."""
        (x1, x2), (y1, y2) = self._at[0, column : column + 2], self._at[1, row : row + 2]
        return np.array([0.5 * (x1 + x2), 0.5 * (y1 + y2)])

    def doorway(self, column: int, row: int, axis: int) -> Floats:
        """Return the middle of the doorway from a room to the next one along x (axis 0) or y (axis 1), m."""
        place = self.middle(column, row)
        k, j = (column + 1, row) if axis == 0 else (row + 1, column)
        place[axis] = self._at[axis, k]
        place[1 - axis] += self._offsets[axis, k, j]
        return place

    def drive(self, seed: int, step_m: float, length_m: float) -> Floats:
        """Return poses of a ring that is driven from room to room: x, y (m) and direction (rad), shape (n, 3).

        Parameters
        ----------
        seed : int
            Which drive.
        step_m : float
            Distance between poses.
        length_m : float
            Way driven.
        """
        rng = np.random.default_rng(np.random.SeedSequence([seed, 23]))
        here, yaw = rng.integers(0, self.rooms, 2), float(rng.uniform(-math.pi, math.pi))
        places, driven, before = [self.middle(*here.tolist())], 0.0, -here
        while driven < length_m:
            axis, way = int(rng.integers(2)), int(rng.choice([-1, 1]))
            there = here.copy()
            there[axis] += way
            if not 0 <= there[axis] < self.rooms or (there == before).all():
                continue
            first = here if way > 0 else there
            places += [self.doorway(int(first[0]), int(first[1]), axis), self.middle(*there.tolist())]
            driven += math.dist(places[-3], places[-2]) + math.dist(places[-2], places[-1])
            before, here = here, there
        corners = np.array(places)
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
        at = np.arange(0.0, length_m, step_m)
        x, y = (np.interp(at, along, corners[:, k]) for k in (0, 1))
        return np.column_stack([x, y, np.full(len(at), yaw)])
