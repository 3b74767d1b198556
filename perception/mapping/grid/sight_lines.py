"""Which cells a line of sight has crossed: what none has crossed is unknown, whatever passages a grid counts there.

Among mirrors a beam that meets a slanting wall is silent, or answers late by a detour over other surfaces. So neither
silence nor a long range proves that a beam went through:

- an echo from something recognised came on a straight line, and that line was open, if two places say so;
- an echo from something that the grid holds came on one of the lines that end there: each is open by its share;
- any other echo proves its beam open only where slanting walls answer, and then little by itself;
- silence proves nothing;
- no line goes on behind the first cell that holds something.

How far the lines to what the grid holds can be believed is learnt. Where as many echoes pass over what it holds as
come from it, ranges and cells have nothing to do with each other, as among mirrors with many strays. And where half
of the echoes come from something recognised, the others are strays as likely as not. Readings from one place on the
way count as the strongest of them, since their errors are not independent.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from drivers.messages import Firing
from perception.bounds import Bound, bounds
from perception.kernel import Floats, Ints, kernel
from perception.mapping.grid.cell_evidence import PLACE_NUMBERS
from perception.mapping.grid.window import (
    SPREAD_CELLS,
    SPREAD_RELATIVE,
    Beams,
    Raster,
    Ring,
    Window,
    beams_of,
    columns_of_beam,
    is_possible,
    rows_within,
    set_edges,
)
from perception.sensor_mounts import SensorPose, sensor_pose
from perception.shared_numbers import PASSED_M

LOCATED_RAD: Final = 0.07
"""Greatest angle off the line on which an echo from something recognised came, rad. In three random rooms with
doorways, among mirrors with late strays, 0.5 and 1.5 % of the cells called free are out of reach with 0.05 and 0.1,
and 5 % with the whole beam."""
LOCATED_CELLS: Final = 1.0
"""Nor farther off it than this, cells: what is recognised is known to centimetres, and far away a beam as wide as
`LOCATED_RAD` to a corner crosses the walls beside it. In twenty rooms of mirrors (seeds 900 to 919) .65 % of the
cells called free were out of reach without this and .13 % with it, 3.31 and .69 % in the worst room; of the reachable
cells it takes .7 points from what is called free."""
LOCATED_PLACES_MIN: Final = 2
"""A cell was crossed if such lines from so many places crossed it: one echo may be explained wrongly. In twenty rooms
of mirrors with late strays (seeds 5200 to 5219) one wrong line of 4 m opened 1.1 % of a room."""
PLACES_MIN: Final = 6
"""Where slanting walls answer, a cell was crossed if echoes passed it from so many places. Twice as many change what
is out of reach by less than 0.2 %."""
MIRRORS_MIN: Final = 0.5
"""From so far a place of mirrors on, such echoes count for nothing: 20 % would be out of reach."""
COUNT_MAX: Final = 1000
"""More places are not counted."""
RAYS: Final = 16
"""Lines along which a beam is followed to what holds something."""
MIDDLE_SHARE: Final = 0.6
"""Echoes are counted as from or over what holds something on so much of the beam around its axis."""
OVER_MAX: Final = 0.5
"""From this share of echoes over what holds something on, the lines count for nothing. The share is .30 in a real
drive where everything echoes, .35 and .38 in real ones among mirrors, and .57 to .73 in generated rooms of mirrors in
which a third of the silent readings come late: there one in five of the cells that the lines add is out of reach."""
EXPLAINED_MAX: Final = 0.5
"""From this share of recognised echoes on likewise. It is .02, .04 and .06 in these drives, and .42 and
.48 in two rooms of mirrors without late readings: there 5 and 30 % of such cells are out of reach."""
OVER_PRIOR: Final = 10.0
"""Echoes that are assumed to have passed over something, before any was heard."""
ECHOES_COUNTED_MAX: Final = 40000.0
"""When so many were counted, all counts are halved."""
LINES_MIN: Final = 2.5
"""A cell was crossed if so many lines are expected to have crossed it. Fewer open more cells, and more of them with
something in them."""
UNITS_PER_LINE: Final = 64
"""One line is kept as this many units."""
COUNT, BLOCK_STAMP, LOCATED, LINES, NOW, LOCATED_STAMP = range(6)
"""What is kept of a cell: from how many places echoes passed it; the last of them; from how many places a recognised
thing's echo did, on its own line; how many lines are expected to have crossed it before this place, and from this
place; and the last place of those lines."""

Flags = NDArray[np.bool_]


@kernel
def follow_rays(
    holds: Flags,
    raster: Raster,
    sensor: SensorPose,
    sine: float,
    r: float,
    sigma: float,
    blocked_m: Floats,
    shares: Floats,
) -> int:
    """Follow the lines of a beam; return 1 if its echo came from something that holds, -1 if over it, 0 otherwise.

    Parameters
    ----------
    holds, raster
        As of `enter_sights`.
    sensor : SensorPose
        Place (m) and direction (rad) of the sensor.
    sine : float
        Of half the beam's width.
    r, sigma : float
        Its range and the range's standard deviation, m.
    blocked_m : (`RAYS`,) float
        Out: the distance to what holds something along each line before the echo, m.
    shares : (`RAYS`,) float
        Out: the share of the echo that each line has, with those beside it.
    """
    corner, cell_m = raster
    sx, sy, axis = sensor
    mask = holds.shape[0] - 1
    ux = math.cos(axis)
    uy = math.sin(axis)
    end = r - sigma
    nearest = math.inf
    answers = 0
    in_middle = False
    bits = 0
    for ray in range(RAYS):
        across = 2.0 * (ray + 0.5) / RAYS - 1.0
        off = math.asin(across * sine)
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
        if abs(across) <= MIDDLE_SHARE:
            nearest = min(nearest, blocked_m[ray])
        if blocked_m[ray] < end - 2.0 * sigma - cell_m:
            continue
        for step in range(-2, 3):
            t = r + 0.5 * step * sigma
            ix = math.floor((sx + t * vx) / cell_m)
            iy = math.floor((sy + t * vy) / cell_m)
            if 0 <= ix - corner[0] <= mask and 0 <= iy - corner[1] <= mask and holds[iy & mask, ix & mask]:
                bits |= 1 << ray
                answers += 1
                in_middle = in_middle or abs(across) <= MIDDLE_SHARE
                break
    for ray in range(RAYS):
        beside = ((bits << 1) >> ray) & 7  # the line and both beside it
        shares[ray] = ((beside & 1) + (beside >> 1 & 1) + (beside >> 2)) / max(1, answers)
    return -1 if nearest < r - PASSED_M else 1 if in_middle else 0


@kernel
def enter_sights(
    sights: NDArray[np.int16],
    holds: Flags,
    raster: Raster,
    place: int,
    beams: Beams,
    blocked_m: Floats,
    shares: Floats,
    edges: Floats,
    echoes: Floats,
) -> None:
    """Enter the lines of sight of a firing.

    Parameters
    ----------
    sights : (n, n, 6) int16
        The torus: what is kept of each cell. Updated.
    holds : (n, n) bool
        The torus: cells that hold something.
    raster, place, beams
        As of `directed.enter_readings`.
    blocked_m, shares : (`RAYS`,) float
        Scratch, as of `follow_rays`.
    edges : (4,) float
        Scratch.
    echoes : (4,) float
        How many echoes that nothing recognised explains came from what holds something, how many over it, how many of
        these there are at all, and how many echoes something explains. Updated.
    """
    _, cell_m = raster
    ranges, mounts, bearings, half_angle = beams.ranges, beams.mounts, beams.bearings, beams.half_angle
    mask = holds.shape[0] - 1
    sine = math.sin(half_angle)
    for i in range(ranges.shape[0]):
        r = ranges[i]
        if not math.isfinite(r):
            continue
        sx, sy, axis = sensor_pose(mounts, i, beams.pose)
        ux = math.cos(axis)
        uy = math.sin(axis)
        sigma = max(SPREAD_CELLS * cell_m, SPREAD_RELATIVE * r)
        end = r - sigma
        is_located = not math.isnan(bearings[i])
        came = follow_rays(holds, raster, (sx, sy, axis), sine, r, sigma, blocked_m, shares)
        echoes[3 if is_located else 2] += 1.0
        if not is_located and came != 0:
            echoes[0 if came > 0 else 1] += 1.0
        set_edges(axis, half_angle, edges)
        low_y, high_y = rows_within(raster, sy, end, mask)
        for iy in range(low_y, high_y + 1):
            dy = (iy + 0.5) * cell_m - sy
            low_x, high_x = columns_of_beam(raster, sx, dy, end, edges, mask)
            for ix in range(low_x, high_x + 1):
                dx = (ix + 0.5) * cell_m - sx
                d = math.hypot(dx, dy)
                across = (ux * dy - uy * dx) / max(d * sine, 1e-12)
                ray = min(RAYS - 1, max(0, int(0.5 * (across + 1.0) * RAYS)))
                if d >= blocked_m[ray]:
                    continue
                kept = sights[iy & mask, ix & mask]
                if kept[BLOCK_STAMP] != place:
                    kept[BLOCK_STAMP] = place
                    kept[COUNT] = min(COUNT_MAX, int(kept[COUNT]) + 1)
                    kept[LINES] = min(COUNT_MAX, int(kept[LINES]) + int(kept[NOW]))
                    kept[NOW] = 0
                kept[NOW] = max(int(kept[NOW]), int(UNITS_PER_LINE * shares[ray]))
                if is_located:
                    off = math.asin(min(1.0, max(-1.0, across)) * sine)
                    is_on_line = abs(off - bearings[i]) <= min(LOCATED_RAD, LOCATED_CELLS * cell_m / max(d, 1e-12))
                    if is_on_line and kept[LOCATED_STAMP] != place:
                        kept[LOCATED_STAMP] = place
                        kept[LOCATED] = min(COUNT_MAX, int(kept[LOCATED]) + 1)


@kernel
def fill_crossed(sights: NDArray[np.int16], corner: Ints, places: int, units: float, out: Flags) -> None:
    """Write which cells a line of sight has crossed.

    Parameters
    ----------
    sights
        As of `enter_sights`; nothing is updated.
    corner : (2,) int
        The number of the window's first cell in x and y.
    places : int
        From so many places echoes passed such a cell, or …
    units : float
        … so many units of lines are expected to have crossed it.
    out : (n, n) bool
        Out: row by row from the smallest y.
    """
    mask = out.shape[0] - 1
    for row in range(out.shape[0]):
        for column in range(out.shape[1]):
            kept = sights[(corner[1] + row) & mask, (corner[0] + column) & mask]
            out[row, column] = (
                kept[COUNT] >= places or kept[LOCATED] >= LOCATED_PLACES_MIN or int(kept[LINES]) + kept[NOW] >= units
            )


class SightLines:
    """The cells that lines of sight have crossed.

    Parameters
    ----------
    window : Window
        Where the cells are.
    ring : Ring
        The sensors.
    """

    SCRATCH: Final = ("_window", "_ring", "_blocked_m", "_shares", "_edges")
    BOUNDS: Final = bounds(sights=Bound(0, PLACE_NUMBERS - 1), _echoes=Bound(0, ECHOES_COUNTED_MAX))

    def __init__(self, window: Window, ring: Ring) -> None:
        self._window = window
        self._ring = ring
        self.sights = np.zeros((window.cells, window.cells, 6), np.int16)
        window.share(self.sights)
        self._echoes = np.zeros(4)
        self._blocked_m = np.zeros(RAYS)
        self._shares = np.zeros(RAYS)
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
        stamp = 1 + place % (PLACE_NUMBERS - 1)
        enter_sights(
            self.sights,
            holds,
            self._window.raster,
            stamp,
            beams_of(firing, self._ring, bearings),
            self._blocked_m,
            self._shares,
            self._edges,
            self._echoes,
        )
        if self._echoes[2:].sum() > 0.5 * ECHOES_COUNTED_MAX:
            self._echoes *= 0.5

    @property
    def trust(self) -> float:
        """How far the lines to what the grid holds can be believed, 0 to 1."""
        came, over, others, explained = self._echoes.tolist()
        over_share = (over + OVER_PRIOR) / (came + over + OVER_PRIOR)
        explained_share = explained / max(1.0, others + explained)
        return max(0.0, 1.0 - over_share / OVER_MAX) * max(0.0, 1.0 - explained_share / EXPLAINED_MAX)

    def crossed(self, mirrors: float, trust: float | None = None) -> Flags:
        """Return which cells a line of sight has crossed: (n, n), row by row from the smallest y.

        Parameters
        ----------
        mirrors : float
            How far this is a place of mirrors, 0 to 1, as is known by now.
        trust : float, optional
            In place of what is learnt from these lines.
        """
        trust = self.trust if trust is None else trust
        least = PLACES_MIN if mirrors < MIRRORS_MIN else COUNT_MAX + 1
        units = UNITS_PER_LINE * LINES_MIN / trust if trust > 0.0 else math.inf
        out = np.empty(self.sights.shape[:2], np.bool_)
        fill_crossed(self.sights, self._window.corner, least, units, out)
        return out

    def clear(self) -> None:
        """Forget everything."""
        self.sights[:] = 0
        self._echoes[:] = 0.0
