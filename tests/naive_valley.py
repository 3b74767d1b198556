"""What the kernels of `behaviors.valley` compute, written out: every cell of a grid, every direction of a disc."""

from __future__ import annotations

import math
from collections.abc import Sequence

from behaviors.valley.polar_histogram import SECTOR_RAD, SECTORS
from perception.percept import Percept

NaiveCell = tuple[float, float, float]
"""dx, dy, and certainty."""
BORDER_M = 1e-6
"""A disc that passes a cell so nearly touches it, m, that rounding decides."""


def cells_near(
    percept: Percept, x: float, y: float, reach_m: float, occupied: float, sure: float,
    only_heard: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> list[NaiveCell]:  # fmt: skip
    """Return what stands near a place, the cells of the grid first."""
    grid, found = percept.occupancy, list[NaiveCell]()
    for row, probabilities in enumerate([] if grid is None else grid.occupied.tolist()):
        for column, probability in enumerate(probabilities):
            assert grid is not None
            dx, dy = grid.x_m + (column + 0.5) * grid.cell_m - x, grid.y_m + (row + 0.5) * grid.cell_m - y
            is_left_out = math.dist((dx, dy), only_heard[:2]) < only_heard[2]
            if probability > occupied and math.hypot(dx, dy) < reach_m and not is_left_out:
                found.append((dx, dy, min(1.0, (probability - occupied) / (sure - occupied))))
    echoes = [(ex - x, ey - y, 1.0) for ex, ey in percept.obstacles.tolist()]
    return found + [echo for echo in echoes if math.hypot(*echo[:2]) < reach_m]


def touched(cells: Sequence[NaiveCell], radius_m: float, way_m: float, *, in_part: bool) -> list[bool | None]:
    """Return for each sector whether a disc that drives along its middle touches a cell; None where rounding decides.

    A cell in the disc is moved to its rim: it is touched by every way that does not lead away from it.
    """
    sectors = list[bool | None]()
    for sector in range(SECTORS):
        ux, uy = math.cos(sector * SECTOR_RAD), math.sin(sector * SECTOR_RAD)
        nearest = math.inf
        for dx, dy, certainty in cells:
            distance = math.hypot(dx, dy)
            if distance >= radius_m + (certainty * way_m if in_part else way_m):
                continue
            outward = max(1.0, radius_m / distance)
            x, y = outward * dx, outward * dy
            along = min(way_m, max(0.0, x * ux + y * uy))
            if outward == 1.0 or along > 0.0:
                nearest = min(nearest, math.hypot(x - along * ux, y - along * uy))
        sectors.append(None if abs(nearest - radius_m) < BORDER_M else nearest < radius_m)
    return sectors
