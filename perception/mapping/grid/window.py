"""The window of cells that moves with the robot, and the cells of a beam: what all grids share.

The window is a torus: a cell keeps its place in memory as long as it is in the window, and only the rows and columns
that leave are cleared. Cells are numbered from the odometry's origin, so that a cell covers the same floor for ever.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from drivers.messages import Firing, Pose
from perception.bounds import CONSTANT, Bound, bounds
from perception.kernel import Floats, Ints, kernel
from perception.sensor_mounts import RingPose, mounts_at, ring_pose

Cell = TypeVar("Cell", bound=np.generic)

OCTANTS: Final = 8
"""Looking directions, 45° each; the first is around +x, then counter-clockwise."""
EIGHTH_TAN: Final = math.tan(0.125 * math.pi)
"""Of half a looking direction."""
SPREAD_CELLS: Final = 0.5
"""Least standard deviation of an echo's range, in cells."""
SPREAD_RELATIVE: Final = 0.01
"""Least standard deviation of an echo's range, as a share of it."""
CENTRED_CELLS: Final = 4
"""The window follows once the robot is so many cells from its middle."""
DRIVEN_MAX_M: Final = 1e6
"""No robot drives so far; a pose beyond it is a fault."""


@dataclass(frozen=True, slots=True, eq=False)
class Ring:
    """What a grid knows of the sensors."""

    mounts: Floats
    """(n, 3): x, y (m), direction (rad) of each sensor in the ring's frame."""
    half_angle: float
    """Half the beam's width, rad."""
    rounding_m: float
    """Standard deviation of a range by its rounding, m."""
    reach_m: float
    """Longest range, m."""
    turning: tuple[int, ...] = ()
    """The sensors that turn with the wheels, as `config.robot.RingConfig.turning`."""


class Beams(NamedTuple):
    """The beams of a firing, as kernels take them."""

    pose: RingPose
    """Place (m) and direction (rad) of the ring."""
    ranges: Floats
    """(n,): as in a `Firing`, m."""
    mounts: Floats
    """(n, 3): x, y (m), direction (rad) of each sensor in the ring's frame."""
    bearings: Floats
    """(n,): where in its beam each echo came from, rad from the axis; NaN where that is not known."""
    half_angle: float
    """Half the beam's width, rad."""


Raster: TypeAlias = tuple[Ints, float]
"""The number of the window's first cell in x and y, and the side of a cell, m."""


@kernel
def octant(dx: float, dy: float) -> int:
    """Return the looking direction of a vector, 0 to 7."""
    if abs(dy) <= EIGHTH_TAN * abs(dx):
        return 0 if dx > 0.0 else 4
    if abs(dx) <= EIGHTH_TAN * abs(dy):
        return 2 if dy > 0.0 else 6
    if dx > 0.0:
        return 1 if dy > 0.0 else 7
    return 3 if dy > 0.0 else 5


@kernel
def row_of_beam(dy: float, reach: float, edges: Floats) -> tuple[float, float]:
    """Return between which x from the sensor a row of cells lies in a beam, m; the first is greater if nowhere.

    Parameters
    ----------
    dy : float
        The row's y from the sensor, m.
    reach : float
        Length of the beam, m.
    edges : (4,) float
        The directions of its right and its left edge, unit vectors x, y, x, y; less than 180° apart.
    """
    square = reach * reach - dy * dy
    if square <= 0.0:
        return 1.0, -1.0
    high = math.sqrt(square)
    low = -high
    if edges[1] > 0.0:
        high = min(high, dy * edges[0] / edges[1])
    elif edges[1] < 0.0:
        low = max(low, dy * edges[0] / edges[1])
    elif dy * edges[0] < 0.0:
        return 1.0, -1.0
    if edges[3] > 0.0:
        low = max(low, dy * edges[2] / edges[3])
    elif edges[3] < 0.0:
        high = min(high, dy * edges[2] / edges[3])
    elif dy * edges[2] > 0.0:
        return 1.0, -1.0
    return low, high


@kernel
def rows_within(raster: Raster, sy: float, reach: float, mask: int) -> tuple[int, int]:
    """Return the first and the last row of a window's cells that come as near to a y as `reach`, m.

    Parameters
    ----------
    raster : Raster
        Of the window.
    sy, reach : float
        m.
    mask : int
        Rows of the window, less one.
    """
    corner, cell_m = raster
    first = max(int(corner[1]), math.floor((sy - reach) / cell_m))
    return first, min(int(corner[1]) + mask, math.floor((sy + reach) / cell_m))


@kernel
def columns_of_beam(raster: Raster, sx: float, dy: float, reach: float, edges: Floats, mask: int) -> tuple[int, int]:
    """Return the first and the last column of a row whose middles lie in a beam; the first is greater if none does.

    Parameters
    ----------
    raster, mask
        As for `rows_within`.
    sx : float
        The sensor's x, m.
    dy, reach, edges
        As for `row_of_beam`.
    """
    corner, cell_m = raster
    low, high = row_of_beam(dy, reach, edges)
    if low > high:
        return 1, 0
    first = max(int(corner[0]), math.ceil((sx + low) / cell_m - 0.5))
    return first, min(int(corner[0]) + mask, math.floor((sx + high) / cell_m - 0.5))


@kernel
def set_edges(bearing: float, half_angle: float, edges: Floats) -> None:
    """Write the edges of a beam as `row_of_beam` takes them."""
    edges[0] = math.cos(bearing - half_angle)
    edges[1] = math.sin(bearing - half_angle)
    edges[2] = math.cos(bearing + half_angle)
    edges[3] = math.sin(bearing + half_angle)


def is_possible(pose: Pose) -> bool:
    """Return whether a robot can have a pose."""
    return abs(pose.x) < DRIVEN_MAX_M and abs(pose.y) < DRIVEN_MAX_M and math.isfinite(pose.theta)


def beams_of(firing: Firing, ring: Ring, bearings: Floats) -> Beams:
    """Return the beams of a firing, given where in them the echoes came from."""
    mounts = mounts_at(firing, ring.mounts, ring.turning)
    return Beams(ring_pose(firing), firing.ranges_m, mounts, bearings, ring.half_angle)


def placed(firing: Firing, ring: Ring) -> list[list[float]]:
    """Return place x, y (m) and direction (rad) of each sensor at a firing."""
    mounts = mounts_at(firing, ring.mounts, ring.turning)
    c, s = math.cos(firing.ring_yaw), math.sin(firing.ring_yaw)
    x = firing.pose.x + c * mounts[:, 0] - s * mounts[:, 1]
    y = firing.pose.y + s * mounts[:, 0] + c * mounts[:, 1]
    return np.column_stack([x, y, firing.ring_yaw + mounts[:, 2]]).tolist()  # type: ignore[no-any-return]  # numpy's own


def _corner_bound(window: Window) -> Bound:
    """Return the bound of the number of the window's first cell."""
    most = math.ceil(DRIVEN_MAX_M / window.cell_m) + window.cells
    return Bound(-most, most)


class Window:
    """The place of the window.

    Parameters
    ----------
    cells : int
        Cells along each side, a power of two.
    cell_m : float
        Side of a cell, m.
    """

    SCRATCH: Final = ("_shared",)
    BOUNDS: Final = bounds(cells=CONSTANT, cell_m=CONSTANT, corner=_corner_bound)

    def __init__(self, cells: int, cell_m: float) -> None:
        self.cells = cells
        self.cell_m = cell_m
        self.corner: Ints = np.zeros(2, np.int64)
        """The number of the first cell in x and y, counted from the odometry's origin."""
        self.placed = False
        self.fixed = False
        self._shared: list[NDArray[np.generic]] = []

    @property
    def raster(self) -> Raster:
        """Where the cells are, as kernels take it."""
        return self.corner, self.cell_m

    def share(self, plane: NDArray[np.generic]) -> None:
        """Clear a plane of the cells' memory, too, wherever cells come in; see `follow`."""
        self._shared.append(plane)

    def fix(self, x: float, y: float) -> None:
        """Put the middle of the window at a place (m) for good: it no longer follows the robot."""
        self.corner[:] = [math.floor(at / self.cell_m) - self.cells // 2 for at in (x, y)]
        self.placed = self.fixed = True

    def follow(self, pose: Pose, planes: tuple[NDArray[np.generic], ...]) -> bool:
        """Move the window after the robot and clear what comes in; return whether the pose is a possible one.

        Parameters
        ----------
        pose : Pose
            The robot's.
        planes : tuple of array
            The cells' memory, each of shape (cells, cells, …): y, then x. Updated; those that share the window, too.
        """
        if not is_possible(pose):
            return False
        if self.fixed:
            return True
        for axis, at in enumerate((pose.x, pose.y)):
            wanted = math.floor(at / self.cell_m) - self.cells // 2
            moved = wanted - int(self.corner[axis])
            if self.placed and abs(moved) <= CENTRED_CELLS:
                continue
            if self.placed:
                count = min(abs(moved), self.cells)
                first = int(self.corner[axis]) + (self.cells if moved > 0 else -count)
                lines = np.arange(first, first + count) & (self.cells - 1)
                for plane in (*planes, *self._shared):
                    if axis == 0:
                        plane[:, lines] = 0
                    else:
                        plane[lines] = 0
            self.corner[axis] = wanted
        self.placed = True
        return True

    def unrolled(self, plane: NDArray[Cell]) -> NDArray[Cell]:
        """Return a plane of the torus row by row from the smallest y, as an array of its own."""
        x, y = (int(first) & (self.cells - 1) for first in self.corner)
        return np.roll(plane, (-y, -x), axis=(0, 1))

    def rolled(self, rows: NDArray[Cell]) -> NDArray[Cell]:
        """Return the plane of the torus whose rows from the smallest y on are given, as an array of its own."""
        x, y = (int(first) & (self.cells - 1) for first in self.corner)
        return np.roll(rows, (y, x), axis=(0, 1))

    def clear(self) -> None:
        """Forget the place, unless it is fixed."""
        if not self.fixed:
            self.corner[:] = 0
            self.placed = False
