"""Moravec and Elfes, *High Resolution Maps from Wide Angle Sonar* (ICRA 1985): empty and occupied apart.

A reading makes the inside of its beam probably empty and its arc probably occupied; the greater of the two decides.
One echo is one unit of occupied evidence, however wide its arc. Every reading counts in every direction, so what a
smooth wall does not answer erases it.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from drivers.messages import Firing
from perception.bounds import SHARE, bounds
from perception.kernel import Floats, kernel
from perception.mapping.grid.window import Raster, Ring, Window, columns_of_beam, placed, rows_within, set_edges
from perception.sensor_mounts import SensorPose

EMPTY, OCCUPIED = range(2)
"""The two values of a cell."""
ACCURACY: Final = 0.01
"""ε: error of a range as a share of it."""
ACCURACY_CELLS: Final = 0.65
"""Least error of a range in cells: with less, an arc would miss all their centres."""
NEAREST_M: Final = 0.15
"""R_min: what is nearer than this is empty for certain, m."""


@kernel
def enter_reading(
    cells: Floats,
    raster: Raster,
    sensor: SensorPose,
    half_angle: float,
    r: float,
    accuracy_m: float,
    edges: Floats,
) -> None:
    """Enter a reading.

    E and O are the profiles of the beam's inside and of its arc::

        E = (1 − ((d − R_min) / (r − ε − R_min))²) · (1 − (θ/h)²)     for d ≤ r − ε
        O = (1 − ((d − r) / ε)²) · (1 − (θ/h)²)                      for |d − r| ≤ ε

        empty ← empty + E − empty · E;  O ← O · (1 − empty);  O ← O / ΣO;  occupied ← occupied + O − occupied · O

    Parameters
    ----------
    cells : (n, n, 2) float
        The torus. Updated.
    raster : Raster
        Where the cells are.
    sensor : SensorPose
        Place (m) and direction (rad) of the sensor.
    half_angle : float
        h: half the beam's width, rad.
    r : float
        Range, m.
    accuracy_m : float
        ε, m; 0 for a beam without an echo that is empty up to `r`.
    edges : (4,) float
        Scratch.
    """
    mask = cells.shape[0] - 1
    _, cell_m = raster
    sx, sy, axis = sensor
    set_edges(axis, half_angle, edges)
    ux = math.cos(axis)
    uy = math.sin(axis)
    inner = r - accuracy_m
    outer = r + accuracy_m
    total = 0.0
    low_y, high_y = rows_within(raster, sy, outer, mask)
    for step in range(3):  # the beam's inside; the sum over the arc; the arc
        for iy in range(low_y, high_y + 1):
            dy = (iy + 0.5) * cell_m - sy
            low_x, high_x = columns_of_beam(raster, sx, dy, outer, edges, mask)
            for ix in range(low_x, high_x + 1):
                dx = (ix + 0.5) * cell_m - sx
                theta = math.atan2(ux * dy - uy * dx, ux * dx + uy * dy)
                across = 1.0 - (theta / half_angle) ** 2
                d = math.hypot(dx, dy)
                cell = cells[iy & mask, ix & mask]
                if step == 0 and d <= inner:
                    depth = max(0.0, d - NEAREST_M) / max(cell_m, inner - NEAREST_M)
                    empty = max(0.0, (1.0 - depth * depth) * across)
                    cell[EMPTY] += empty * (1.0 - cell[EMPTY])
                elif step > 0 and accuracy_m > 0.0 and abs(d - r) < accuracy_m:
                    share = max(0.0, (1.0 - ((d - r) / accuracy_m) ** 2) * across) * (1.0 - cell[EMPTY])
                    if step == 1:
                        total += share
                    elif total > 0.0:
                        cell[OCCUPIED] += share / total * (1.0 - cell[OCCUPIED])


class MoravecElfesGrid:
    """The grid's memory.

    Parameters
    ----------
    window : Window
        Where its cells are.
    ring : Ring
        The sensors.
    """

    mirrors: Final = 1.0
    """How far this is a place of mirrors: not known to this method, so as far as can be."""
    SCRATCH: Final = ("window", "_ring", "_half_angle", "_edges")
    BOUNDS: Final = bounds(cells=SHARE)

    def __init__(self, window: Window, ring: Ring) -> None:
        self.window = window
        self._ring = ring
        self._half_angle = ring.half_angle
        self.cells: Floats = np.zeros((window.cells, window.cells, 2))
        self._edges = np.zeros(4)

    def observe(self, firing: Firing, bearings: Floats, place: int, silence_m: float) -> None:
        """Enter a firing; repeats and known bearings make no difference to this method."""
        del bearings, place
        if not self.window.follow(firing.pose, (self.cells,)):
            return
        cell_m = self.window.cell_m
        for (sx, sy, axis), r in zip(placed(firing, self._ring), firing.ranges_m.tolist(), strict=True):
            if math.isnan(r) or (r == math.inf and silence_m == 0.0):
                continue
            accuracy_m = max(ACCURACY_CELLS * cell_m, ACCURACY * r) if r < math.inf else 0.0
            enter_reading(
                self.cells,
                self.window.raster,
                (sx, sy, axis),
                self._half_angle,
                r if r < math.inf else silence_m,
                accuracy_m,
                self._edges,
            )

    def probability(self, seen_from: tuple[float, float] | None) -> NDArray[np.float32]:
        """Return the probability of each cell: ½ + ½ occupied, or ½ − ½ empty where that is greater."""
        del seen_from
        cells = self.window.unrolled(self.cells)
        empty, occupied = cells[..., EMPTY], cells[..., OCCUPIED]
        return (0.5 + 0.5 * np.where(occupied >= empty, occupied, -empty)).astype(np.float32)

    def holding(self) -> NDArray[np.bool_]:
        """Return which cells of the torus are rather occupied."""
        return np.asarray((self.cells[..., OCCUPIED] >= self.cells[..., EMPTY]) & (self.cells[..., OCCUPIED] > 0.0))

    def drop_caches(self) -> None:
        """Do nothing: nothing depends on the cells."""

    def clear(self) -> None:
        """Forget everything."""
        self.window.clear()
        self.cells[:] = 0.0
