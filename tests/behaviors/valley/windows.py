"""Evidence grids that are drawn from surfaces, for tests of behaviours."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from perception.percept import OccupancyWindow, Percept, Pose
from tests.behaviors.views import EVERYWHERE

Wall = tuple[float, float, float, float]


def window(walls: Iterable[Wall], *, across_m: float = 12.8, probability: float = 0.95) -> OccupancyWindow:
    """Return the grid around the origin in which the cells on these walls are occupied."""
    cell_m = 0.1
    count = round(across_m / cell_m)
    occupied = np.full((count, count), 0.5, dtype=np.float32)
    corner = -0.5 * across_m
    for x1, y1, x2, y2 in walls:
        for share in np.linspace(0.0, 1.0, 2 + math.ceil(math.dist((x1, y1), (x2, y2)) / (0.5 * cell_m))):
            column = math.floor((x1 + share * (x2 - x1) - corner) / cell_m)
            row = math.floor((y1 + share * (y2 - y1) - corner) / cell_m)
            occupied[row, column] = probability
    return OccupancyWindow(occupied, corner, corner, cell_m)


def at(
    x: float, y: float, theta: float = 0.0, *, walls: Iterable[Wall] = (), echoes: Iterable[tuple[float, float]] = ()
) -> Percept:
    """Return the percept of a robot there."""
    points = np.array(list(echoes), dtype=np.float64).reshape(-1, 2)
    return Percept(Pose(x, y, theta), points, EVERYWHERE, occupancy=window(walls))
