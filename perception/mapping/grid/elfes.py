"""Elfes, *Using Occupancy Grids for Mobile Robot Perception and Navigation* (Computer 22(6), 1989): Bayes' rule.

A cell holds the log odds of being occupied, and each reading adds what it says by itself: below one half before the
range, a peak at the range, one half behind. As in 1985, one echo is one unit of evidence over its arc. Every reading
counts in every direction.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from drivers.messages import Firing
from perception.bounds import Bound, bounds
from perception.kernel import Floats, kernel
from perception.mapping.grid.window import (
    SPREAD_CELLS,
    SPREAD_RELATIVE,
    Raster,
    Ring,
    Window,
    columns_of_beam,
    placed,
    rows_within,
    set_edges,
)
from perception.sensor_mounts import SensorPose

BEAM_SIGMAS: Final = 2.0
"""The beam's half width in σ_θ."""
ARC_SIGMAS: Final = 2.0
"""Half the thickness of an echo's arc, in σ_r."""
PEAK: Final = 0.49
"""How far the probability on the arc is above one half at most: at one, its log odds would be infinite."""
ELFES_UNIT: Final = 4.0
"""An echo's unit of evidence: a cell with a quarter of the arc's mass rises by the full peak."""
EMPTY_PEAK: Final = 0.2
"""How far the probability before the range is below one half, on the axis."""
LOG_ODDS_MAX: Final = 8.0
"""Greatest log odds for and against, nat: contradiction must remain possible."""


@kernel
def enter_reading(
    log_odds: Floats,
    raster: Raster,
    sensor: SensorPose,
    half_angle: float,
    r: float,
    sigma: float,
    edges: Floats,
) -> None:
    """Enter a reading: add the log odds of p(occupied | r) to each cell of the beam.

    With the weight w of a direction and the share m of the arc's mass::

        w = exp(−½ (θ/σ_θ)²);  m = w · exp(−½ ((d − r)/σ_r)²) / Σ
        p = ½ − EMPTY_PEAK · w                  for d < r − ARC_SIGMAS · σ_r
        p = ½ + PEAK · min(1, ELFES_UNIT · m)    on the arc

    Parameters
    ----------
    log_odds : (n, n) float
        The torus. Updated.
    raster, sensor, half_angle, r, edges
        As of `moravec_elfes.enter_reading`.
    sigma : float
        σ_r, m; 0 for a beam without an echo that is empty up to `r`.
    """
    mask = log_odds.shape[0] - 1
    _, cell_m = raster
    sx, sy, axis = sensor
    set_edges(axis, half_angle, edges)
    ux = math.cos(axis)
    uy = math.sin(axis)
    inner = r - ARC_SIGMAS * sigma
    outer = r + ARC_SIGMAS * sigma
    total = 0.0
    low_y, high_y = rows_within(raster, sy, outer, mask)
    for step in range(2):  # the beam's inside and the sum over the arc; the arc
        for iy in range(low_y, high_y + 1):
            dy = (iy + 0.5) * cell_m - sy
            low_x, high_x = columns_of_beam(raster, sx, dy, outer, edges, mask)
            for ix in range(low_x, high_x + 1):
                dx = (ix + 0.5) * cell_m - sx
                theta = math.atan2(ux * dy - uy * dx, ux * dx + uy * dy)
                across = math.exp(-0.5 * (BEAM_SIGMAS * theta / half_angle) ** 2)
                d = math.hypot(dx, dy)
                value = log_odds[iy & mask, ix & mask]
                p = 0.5
                if d < inner:
                    p -= EMPTY_PEAK * across if step == 0 else 0.0
                elif sigma > 0.0:
                    mass = across * math.exp(-0.5 * ((d - r) / sigma) ** 2)
                    if step == 0:
                        total += mass
                    else:
                        p += PEAK * min(1.0, ELFES_UNIT * mass / total)
                value += math.log(p / (1.0 - p))
                log_odds[iy & mask, ix & mask] = min(LOG_ODDS_MAX, max(-LOG_ODDS_MAX, value))


class ElfesGrid:
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
    SCRATCH: Final = ("window", "_ring", "_half_angle", "_rounding_m", "_edges")
    BOUNDS: Final = bounds(log_odds=Bound(-LOG_ODDS_MAX, LOG_ODDS_MAX))

    def __init__(self, window: Window, ring: Ring) -> None:
        self.window = window
        self._ring = ring
        self._half_angle = ring.half_angle
        self._rounding_m = ring.rounding_m
        self.log_odds: Floats = np.zeros((window.cells, window.cells))
        self._edges = np.zeros(4)

    def observe(self, firing: Firing, bearings: Floats, place: int, silence_m: float) -> None:
        """Enter a firing; repeats and known bearings make no difference to this method."""
        del bearings, place
        if not self.window.follow(firing.pose, (self.log_odds,)):
            return
        cell_m = self.window.cell_m
        for (sx, sy, axis), r in zip(placed(firing, self._ring), firing.ranges_m.tolist(), strict=True):
            if math.isnan(r) or (r == math.inf and silence_m == 0.0):
                continue
            sigma = max(SPREAD_CELLS * cell_m, self._rounding_m, SPREAD_RELATIVE * r) if r < math.inf else 0.0
            enter_reading(
                self.log_odds,
                self.window.raster,
                (sx, sy, axis),
                self._half_angle,
                r if r < math.inf else silence_m,
                sigma,
                self._edges,
            )

    def probability(self, seen_from: tuple[float, float] | None) -> NDArray[np.float32]:
        """Return the probability of each cell."""
        del seen_from
        return (1.0 / (1.0 + np.exp(-self.window.unrolled(self.log_odds)))).astype(np.float32)

    def holding(self) -> NDArray[np.bool_]:
        """Return which cells of the torus are rather occupied."""
        return np.asarray(self.log_odds > 0.0)

    def drop_caches(self) -> None:
        """Do nothing: nothing depends on the cells."""

    def clear(self) -> None:
        """Forget everything."""
        self.window.clear()
        self.log_odds[:] = 0.0
