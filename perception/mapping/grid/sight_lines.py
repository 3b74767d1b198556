"""Which cells a line of sight has crossed: what none has crossed is unknown, whatever passages a grid counts there.

Among mirrors a beam that meets a slanting wall is silent, or answers late by a detour over other surfaces. So neither
silence nor a long range proves that a beam went through:

- an echo from something recognised came on a straight line, and that line was open;
- any other echo proves its beam open only where slanting walls answer, and then little by itself;
- silence proves nothing;
- no line goes on behind the first cell that holds something.

Readings from one place on the way count as the strongest of them, since their errors are not independent.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from drivers.messages import Firing
from perception.bounds import Bound, bounds
from perception.kernel import Floats, Ints, kernel
from perception.mapping.grid.cell_evidence import PLACES
from perception.mapping.grid.window import (
    SPREAD_CELLS,
    SPREAD_RELATIVE,
    Ring,
    Window,
    is_possible,
    row_of_beam,
    set_edges,
)
from perception.sensor_mounts import mounts_at

LOCATED_RAD: Final = 0.07
"""Greatest angle off the line on which an echo from something recognised came, rad. In three random rooms with
doorways, among mirrors with late strays, 0.5 and 1.5 % of the cells called free are out of reach with 0.05 and 0.1,
and 5 % with the whole beam."""
PLACES_MIN: Final = 6
"""Where slanting walls answer, a cell was crossed if echoes passed it from so many places. Twice as many change what
is out of reach by less than 0.2 %."""
MIRRORS_MIN: Final = 0.5
"""From so far a place of mirrors on, such echoes count for nothing: 20 % would be out of reach."""
COUNT_MAX: Final = 1000
"""More places are not counted."""
RAYS: Final = 16
"""Lines along which a beam is followed to what holds something."""
COUNT: Final = 0
STAMP: Final = 1
LINE: Final = 2
"""What is kept of a cell: from how many places echoes passed it; the last of them; 1 where a recognised thing's echo
did, on its own line."""

Flags = NDArray[np.bool_]


@kernel
def enter_sights(
    sights: NDArray[np.int16], holds: Flags, corner: Ints, cell_m: float, place: int, x: float, y: float, yaw: float,
    ranges: Floats, mounts: Floats, bearings: Floats, half_angle: float, blocked_m: Floats, edges: Floats,
) -> None:  # fmt: skip
    """Enter the lines of sight of a firing.

    Parameters
    ----------
    sights : (n, n, 3) int16
        The torus: what is kept of each cell. Updated.
    holds : (n, n) bool
        The torus: cells that hold something.
    corner, cell_m, place, x, y, yaw, ranges, mounts, bearings, half_angle
        As of `directed.enter_readings`.
    blocked_m : (`RAYS`,) float
        Scratch: the distance to what holds something along each line, m.
    edges : (4,) float
        Scratch.
    """
    mask = holds.shape[0] - 1
    sine = math.sin(half_angle)
    c = math.cos(yaw)
    s = math.sin(yaw)
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if not math.isfinite(r):
            continue
        sx = x + c * mounts[i, 0] - s * mounts[i, 1]
        sy = y + s * mounts[i, 0] + c * mounts[i, 1]
        axis = yaw + mounts[i, 2]
        ux = math.cos(axis)
        uy = math.sin(axis)
        end = r - max(SPREAD_CELLS * cell_m, SPREAD_RELATIVE * r)
        for ray in range(RAYS):
            off = math.asin((2.0 * (ray + 0.5) / RAYS - 1.0) * sine)
            vx = ux * math.cos(off) - uy * math.sin(off)
            vy = uy * math.cos(off) + ux * math.sin(off)
            blocked_m[ray] = math.inf
            for step in range(int(end / (0.5 * cell_m)) + 1):
                t = 0.5 * cell_m * step
                ix = math.floor((sx + t * vx) / cell_m)
                iy = math.floor((sy + t * vy) / cell_m)
                if not (0 <= ix - corner[0] <= mask and 0 <= iy - corner[1] <= mask):
                    break
                if holds[iy & mask, ix & mask]:
                    blocked_m[ray] = t
                    break
        set_edges(axis, half_angle, edges)
        low_y = max(int(corner[1]), math.floor((sy - end) / cell_m))
        high_y = min(int(corner[1]) + mask, math.floor((sy + end) / cell_m))
        for iy in range(low_y, high_y + 1):
            dy = (iy + 0.5) * cell_m - sy
            low, high = row_of_beam(dy, end, edges)
            if low > high:
                continue
            low_x = max(int(corner[0]), math.ceil((sx + low) / cell_m - 0.5))
            high_x = min(int(corner[0]) + mask, math.floor((sx + high) / cell_m - 0.5))
            for ix in range(low_x, high_x + 1):
                dx = (ix + 0.5) * cell_m - sx
                d = math.hypot(dx, dy)
                across = (ux * dy - uy * dx) / max(d * sine, 1e-12)
                ray = min(RAYS - 1, max(0, int(0.5 * (across + 1.0) * RAYS)))
                if d >= blocked_m[ray]:
                    continue
                kept = sights[iy & mask, ix & mask]
                if kept[STAMP] != place:
                    kept[STAMP] = place
                    kept[COUNT] = min(COUNT_MAX, int(kept[COUNT]) + 1)
                if abs(math.asin(min(1.0, max(-1.0, across)) * sine) - bearings[i]) <= LOCATED_RAD:
                    kept[LINE] = 1


class SightLines:
    """The cells that lines of sight have crossed.

    Parameters
    ----------
    window : Window
        Where the cells are.
    ring : Ring
        The sensors.
    """

    SCRATCH: Final = ("_window", "_ring", "_blocked_m", "_edges")
    BOUNDS: Final = bounds(sights=Bound(0, PLACES - 1))

    def __init__(self, window: Window, ring: Ring) -> None:
        self._window = window
        self._ring = ring
        self.sights = np.zeros((window.cells, window.cells, 3), np.int16)
        window.share(self.sights)
        self._blocked_m = np.zeros(RAYS)
        self._edges = np.zeros(4)

    def observe(self, firing: Firing, bearings: Floats, place: int, holds: Flags) -> None:
        """Enter a firing.

        Parameters
        ----------
        firing : Firing
            With the robot in the window; one of an impossible pose is left out.
        bearings : (n,) float
            Where in its beam each echo came from, rad from the axis; NaN where that is not known.
        place : int
            Where on its way the robot is.
        holds : (n, n) bool
            The torus: cells that hold something.
        """
        if not is_possible(firing.pose):
            return
        stamp = 1 + place % (PLACES - 1)
        mounts = mounts_at(firing, self._ring.mounts, self._ring.turning)
        enter_sights(
            self.sights, holds, self._window.corner, self._window.cell_m, stamp, float(firing.pose.x),
            float(firing.pose.y), float(firing.ring_yaw), firing.ranges_m, mounts, bearings,
            self._ring.half_angle, self._blocked_m, self._edges,
        )  # fmt: skip

    def crossed(self, mirrors: float) -> Flags:
        """Return which cells of the torus a line of sight has crossed.

        Parameters
        ----------
        mirrors : float
            How far this is a place of mirrors, 0 to 1, as is known by now.
        """
        least = PLACES_MIN if mirrors < MIRRORS_MIN else COUNT_MAX + 1
        return np.asarray((self.sights[..., COUNT] >= least) | (self.sights[..., LINE] == 1))

    def clear(self) -> None:
        """Forget everything."""
        self.sights[:] = 0
