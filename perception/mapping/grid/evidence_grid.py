"""The evidence grid as perception keeps it: the method of the settings, fed with firings, asked for a window.

It counts the robot's way, by which evidence ages and repeats are recognised, and learns how far this place answers at
all: silence shows free space only to the range from which echoes really come. Whatever the method, a cell is free
only if a line of sight has crossed it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from config.robot import RingConfig
from config.settings import GridConfig
from drivers.messages import Firing
from perception.bounds import COUNT, PLACE, bounds
from perception.kernel import Floats
from perception.mapping.grid.sight_lines import SightLines
from perception.mapping.grid.window import Ring, Window
from perception.percept import OccupancyWindow
from perception.sensor_mounts import mounts_array
from perception.shared_numbers import EVEN, READING_M

HEARD_M: Final = 0.25
"""Width of the bins in which ranges are counted."""
HEARD_SHARE: Final = 0.98
"""Silence shows free space up to the range below which this share of the echoes was."""
HEARD_MIN: Final = 20
"""Echoes before which silence shows nothing."""


class GridMethod(Protocol):
    """A method of updating cells."""

    @property
    def mirrors(self) -> float:
        """How far this is a place of mirrors, 0 to 1; 1 where the method does not know."""
        ...

    def observe(self, firing: Firing, bearings: Floats, place: int, silence_m: float) -> None:
        """Enter a firing.

        Parameters
        ----------
        firing : Firing
            In the odometry's frame.
        bearings : (n,) float
            Where in its beam each echo came from, rad from the axis; NaN where that is not known.
        place : int
            Where on its way the robot is, in steps of `READING_M`.
        silence_m : float
            Distance to which a beam without an echo shows free space, m.
        """
        ...

    def probability(self, seen_from: tuple[float, float] | None) -> NDArray[np.float32]:
        """Return the probability of each cell, row by row from the smallest y; see `EvidenceGrid.occupancy`."""
        ...

    def holding(self) -> NDArray[np.bool_]:
        """Return which cells of the torus hold something, seen from any direction, shape (cells, cells)."""
        ...

    def drop_caches(self) -> None:
        """Derive anew what depends on the cells, after they were overwritten."""
        ...

    def clear(self) -> None:
        """Forget everything."""
        ...


def make_grid_method(config: GridConfig, window: Window, ring: Ring) -> GridMethod:
    """Return the method that the settings name; only its kernels are imported, and so compiled."""
    if config.method == "moravec_elfes":
        from perception.mapping.grid.moravec_elfes import MoravecElfesGrid

        return MoravecElfesGrid(window, ring)
    if config.method == "elfes":
        from perception.mapping.grid.elfes import ElfesGrid

        return ElfesGrid(window, ring)
    from perception.mapping.grid.directed import DirectedGrid

    return DirectedGrid(window, ring)


class EvidenceGrid:
    """The grid around the robot, in the odometry's frame.

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    config : GridConfig
        Method, cells and window; the method is not `off`.
    """

    SCRATCH: Final = ("ring",)
    BOUNDS: Final = bounds(
        _way_m=PLACE,
        _at=PLACE._replace(nan=True),
        _heard=COUNT,
        _firings=COUNT,
        bearings=PLACE._replace(nan=True),
    )

    def __init__(self, ring: RingConfig, config: GridConfig) -> None:
        self.ring = Ring(
            mounts_array(ring.mounts),
            math.radians(ring.beam_half_angle_deg),
            ring.resolution_m / math.sqrt(12.0),
            ring.range_max_m,
            ring.turning,
        )
        self.window = Window(config.cells, config.cell_m)
        self.method = make_grid_method(config, self.window, self.ring)
        self.sight_lines = SightLines(self.window, self.ring)
        self._way_m = 0.0
        self._at = np.full(2, math.nan)
        self._heard = np.zeros(int(ring.range_max_m / HEARD_M) + 2, np.int64)
        self._firings = 0
        self._are_mirrors = False
        self.bearings: Floats = np.full(len(ring.mounts), math.nan)
        """Where in its beam each echo of the next firing came from, rad from the axis; NaN where unknown."""

    def observe(self, firing: Firing, *, slanting: int = 0) -> None:
        """Enter a firing, which is given in the odometry's frame, and what is known of slanting walls.

        As of `perception.method.Method.locate_echoes`. What was known stays until the walls say otherwise: the cells
        stay, too, when the walls are forgotten.
        """
        pose, ranges = firing.pose, firing.ranges_m
        moved = math.hypot(pose.x - self._at[0], pose.y - self._at[1])
        if math.isfinite(moved):
            self._way_m += moved
        self._at[:] = pose.x, pose.y
        echoes = ranges[ranges < math.inf]
        np.add.at(self._heard, np.minimum(echoes / HEARD_M, len(self._heard) - 1).astype(np.int64), 1)
        self.method.observe(firing, self.bearings, self.place, self.silence_m)
        self.sight_lines.observe(firing, self.bearings, self.place, self.method.holding())
        self._firings += 1
        self.know_slanting(slanting)

    def know_slanting(self, slanting: int) -> None:
        """Take over what is known of slanting walls, as of `perception.method.Method.locate_echoes`."""
        if slanting != 0:
            self._are_mirrors = slanting < 0

    @property
    def place(self) -> int:
        """Where on its way the robot is, in steps of `READING_M`."""
        return 1 + int(self._way_m / READING_M)

    def crossed_before(
        self, holding: NDArray[np.bool_], firings: Iterable[tuple[Firing, Floats, int]]
    ) -> NDArray[np.bool_]:
        """Return which cells lines of sight of some firings cross before what is known to stand there.

        Parameters
        ----------
        holding : (n, n) bool
            The cells that hold something, row by row from the smallest y.
        firings : iterable of (Firing, (n,) float, int)
            The firings, each with its `bearings` and its `place`.

        Returns
        -------
        (n, n) bool
            As `holding`.
        """
        lines, holds = SightLines(self.window, self.ring), self.window.rolled(holding)
        for firing, bearings, place in firings:
            lines.observe(firing, bearings, place, holds)
        return lines.crossed(self.mirrors, self.sight_lines.trust)

    @property
    def silence_m(self) -> float:
        """Distance to which a beam without an echo shows free space, learnt from the ranges heard, m."""
        total = int(self._heard.sum())
        if total < HEARD_MIN:
            return 0.0
        farthest = int(np.searchsorted(self._heard.cumsum(), HEARD_SHARE * total))
        return min(self.ring.reach_m, HEARD_M * (farthest + 1))

    @property
    def mirrors(self) -> float:
        """How far this is a place of mirrors, 0 to 1: by the recognised walls, and until these are known by cells.

        In a bare square room cells are heard from many sides, though no slanting wall answers.
        """
        return 1.0 if self._are_mirrors else self.method.mirrors

    @property
    def firings(self) -> int:
        """How many firings were entered."""
        return self._firings

    def occupancy(self, seen_from: tuple[float, float] | None = None) -> OccupancyWindow:
        """Return the window.

        Parameters
        ----------
        seen_from : (float, float), optional
            A place x, y, m: then each cell's probability is that of an answer towards it. By default it is that of an
            answer in any direction, and ½ where it would be less in a cell that no line of sight has crossed.
        """
        cell_m = self.window.cell_m
        x, y = (cell_m * float(number) for number in self.window.corner)
        occupied = self.method.probability(seen_from)
        if seen_from is None:
            np.maximum(occupied, EVEN, out=occupied, where=~self.sight_lines.crossed(self.mirrors))
        return OccupancyWindow(occupied, x, y, cell_m)

    def drop_caches(self) -> None:
        """Derive anew what depends on the memory, after it was overwritten."""
        self.method.drop_caches()

    def clear(self) -> None:
        """Forget everything, as after a reset of the odometry."""
        self.method.clear()
        self.sight_lines.clear()
        self._heard[:] = 0
        self._are_mirrors = False
        self.bearings[:] = math.nan
        self._at[:] = math.nan
        self._way_m = 0.0
