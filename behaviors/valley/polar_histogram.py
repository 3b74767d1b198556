"""The binary polar histogram of VFH+: the directions in which something stands in the way.

After Ulrich & Borenstein, *VFH+: Reliable Obstacle Avoidance for Fast Mobile Robots*, ICRA 1998, in units: a cell's
magnitude is its certainty over its distance, so that both thresholds are distances at which a sure cell blocks. The
magnitudes of a sector are not summed, as the grid spreads one echo over the many cells of its arc.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from config.behaviors import FollowValleyConfig
from perception.kernel import Ints, kernel
from perception.percept import Floats, Percept

SECTORS: Final = 72
"""Sectors of 5°, numbered counter-clockwise; the first has its middle along the x axis of odometry."""
SECTOR_RAD: Final = math.tau / SECTORS
FIRM_M: Final = 0.02
"""The robot asks for this much less room than it has where it stands, m: what is beside it does not hold it."""

LINE: Final = 2 * SECTORS
"""Places on a line twice round, on which runs of sectors are laid out: none is longer than half a turn."""
NO_PART: Final = np.empty((0, 0), np.float32)
"""What there is of an evidence grid where there is none."""

Sectors: TypeAlias = NDArray[np.bool_]
"""A flag for each sector, shape (SECTORS,) or, of several discs, (n, SECTORS)."""


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """What may stand in the way near a place."""

    dx: Floats
    dy: Floats
    """(k,): from the place to each occupied cell or fresh echo, m."""
    distances: Floats
    """(k,): their lengths, m."""
    certainties: Floats
    """(k,): above 0, and 1 for a sure cell and for an echo."""


def cells_near(
    percept: Percept,
    x: float,
    y: float,
    reach_m: float,
    config: FollowValleyConfig,
    only_heard: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Cells:
    """Return the cells and fresh echoes within a distance of a place.

    Parameters
    ----------
    percept : Percept
        Its evidence grid and its echoes.
    x, y : float
        The place in odometry's frame, m.
    reach_m : float
        The distance, m.
    config : FollowValleyConfig
        From which probability on a cell counts, and from which it is sure.
    only_heard : tuple of float
        dx, dy from the place to another one, and a distance, m: nearer than that to it, only echoes count.
    """
    window, left, low, cell_m, part = percept.occupancy, 0.0, 0.0, 1.0, NO_PART
    if window is not None:
        cell_m = window.cell_m
        rows, columns = window.occupied.shape
        left, low, reach = (x - window.x_m) / cell_m, (y - window.y_m) / cell_m, reach_m / cell_m
        column, row = max(0, int(left - reach)), max(0, int(low - reach))
        part = window.occupied[
            row : max(row, min(rows, int(low + reach) + 1)), column : max(column, min(columns, int(left + reach) + 1))
        ]
        left, low = column + 0.5 - left, row + 0.5 - low
    # Copies, since a kernel is compiled for one layout in memory.
    part, echoes = np.array(part, np.float32, order="C"), np.array(percept.obstacles, np.float64, order="C")
    found = np.empty((4, part.size + len(echoes)))
    count = fill_cells(
        part,
        (left, low, cell_m),
        echoes,
        (float(x), float(y), float(reach_m)),
        only_heard,
        (config.occupied_probability, config.sure_probability),
        found,
    )
    return Cells(*found[:, :count])


@kernel
def fill_cells(
    part: NDArray[np.float32],
    raster: tuple[float, float, float],
    echoes: Floats,
    near: tuple[float, float, float],
    only_heard: tuple[float, float, float],
    probabilities: tuple[float, float],
    found: Floats,
) -> int:
    """Write the cells, row by row, and the echoes within a distance of a place; return their number.

    Parameters
    ----------
    part : (rows, columns) float32
        Probabilities of the evidence grid around the place.
    raster : (float, float, float)
        From the place to the middle of the part's first cell, in cells, and the side of a cell, m.
    echoes : (n, 2) float
        In odometry's frame, m.
    near : (float, float, float)
        The place and the distance, m.
    only_heard : (float, float, float)
        As for `cells_near`.
    probabilities : (float, float)
        From which one on a cell counts, and from which it is sure.
    found : (4, k) float
        Out: the fields of `Cells`.
    """
    left, low, cell_m = raster
    x, y, reach_m = near
    heard_dx, heard_dy, heard_m = only_heard
    occupied, sure = probabilities
    dx, dy, distances, certainties = found[0], found[1], found[2], found[3]
    count = 0
    for row in range(part.shape[0]):
        for column in range(part.shape[1]):
            above = float(part[row, column]) - occupied
            if not above > 0.0:
                continue
            dx[count] = (column + left) * cell_m
            dy[count] = (row + low) * cell_m
            distances[count] = math.hypot(dx[count], dy[count])
            certainties[count] = min(1.0, above / (sure - occupied))
            if distances[count] < reach_m and math.hypot(dx[count] - heard_dx, dy[count] - heard_dy) >= heard_m:
                count += 1
    for i in range(echoes.shape[0]):
        dx[count] = echoes[i, 0] - x
        dy[count] = echoes[i, 1] - y
        distances[count] = math.hypot(dx[count], dy[count])
        certainties[count] = 1.0
        if distances[count] < reach_m:
            count += 1
    return count


def room_m(cells: Cells, body_radius_m: float, room_max_m: float) -> float:
    """Return the radius of the disc that is driven along a direction: the wanted one, or what there is room for.

    Parameters
    ----------
    cells : Cells
        Around the robot.
    body_radius_m, room_max_m : float
        The least and the wanted radius, m.
    """
    nearest = float(cells.distances.min(initial=math.inf)) - FIRM_M
    return min(room_max_m, max(body_radius_m, nearest))


def crossed(cells: Cells, radii_m: Sequence[float], ways_m: Sequence[float], *, in_part: bool = False) -> Sectors:
    """Return the sectors along whose middle a disc cannot drive some way without touching a cell: (n, SECTORS).

    Parameters
    ----------
    cells : Cells
        The cells.
    radii_m : (n,) sequence of float
        Of the discs, m.
    ways_m : (n,) sequence of float
        Their ways, m. A cell beside a way's end blocks fewer directions than one that is passed.
    in_part : bool
        Whether an uncertain cell blocks only a part of the ways.
    """
    covered = np.empty((len(radii_m), SECTORS), np.bool_)
    cover(
        cells.dx,
        cells.dy,
        cells.distances,
        cells.certainties,
        np.array(radii_m, np.float64),
        np.array(ways_m, np.float64),
        in_part,
        np.empty((len(radii_m), LINE), np.int64),
        covered,
    )
    return covered


@kernel
def cover(
    dx: Floats,
    dy: Floats,
    distances: Floats,
    certainties: Floats,
    radii_m: Floats,
    ways_m: Floats,
    in_part: bool,
    steps: Ints,
    covered: Sectors,
) -> None:
    """Write what `crossed` returns.

    A disc that passes a cell on its way touches it within asin(R/d), the enlargement of VFH+; beside its end, within
    the angle of the law of cosines.

    Parameters
    ----------
    dx, dy, distances, certainties : (k,) float
        As of `Cells`.
    radii_m, ways_m, in_part
        As of `crossed`.
    steps : (n, LINE) int
        Scratch: how many runs of sectors begin at each place of a disc's line, less those that ended before it.
    covered : (n, SECTORS) bool
        Out.
    """
    steps[:] = 0
    covered[:] = False
    for i in range(dx.shape[0]):
        bearing = math.nan
        for n in range(radii_m.shape[0]):
            radius = radii_m[n]
            way = ways_m[n]
            if distances[i] >= radius + (certainties[i] * way if in_part else way):
                continue
            if math.isnan(bearing):
                bearing = math.atan2(dy[i], dx[i]) / SECTOR_RAD + SECTORS
            d = max(distances[i], radius + 1e-9)
            if d * d > way * way + radius * radius:
                half = math.acos(min(1.0, (d * d + (way * way - radius * radius)) / (2.0 * way * d)))
            else:
                half = math.asin(radius / d)
            half *= 1.0 / SECTOR_RAD
            # A run without a sector ends before it begins, and adds nothing.
            steps[n, math.ceil(bearing - half)] += 1
            steps[n, math.floor(bearing + half) + 1] -= 1
    for n in range(radii_m.shape[0]):
        runs = 0
        for at in range(LINE):
            runs += steps[n, at]
            if runs > 0:
                covered[n, at % SECTORS] = True


def masked_by_turning(cells: Cells, heading_rad: float, radius_m: float, turning_radius_m: float) -> Sectors:
    """Return the sectors to which the robot cannot turn, because a cell stands in its turning circle.

    Parameters
    ----------
    cells : Cells
        Around the robot.
    heading_rad : float
        The drive heading, rad.
    radius_m : float
        Of the robot and its safety, m.
    turning_radius_m : float
        Of the least circle that it drives, m; above 0.
    """
    c, s = math.cos(heading_rad), math.sin(heading_rad)
    ahead, left = c * cells.dx + s * cells.dy, c * cells.dy - s * cells.dx
    bearing = np.arctan2(left, ahead)
    reach = (turning_radius_m + radius_m) ** 2
    on_left = (ahead**2 + (left - turning_radius_m) ** 2 < reach) & (bearing >= 0.0)
    on_right = (ahead**2 + (left + turning_radius_m) ** 2 < reach) & (bearing <= 0.0)
    left_limit = float(bearing[on_left].min(initial=math.pi))
    right_limit = float(bearing[on_right].max(initial=-math.pi))
    offsets = (np.arange(SECTORS) * SECTOR_RAD - heading_rad + math.pi) % math.tau - math.pi
    masked: Sectors = (offsets > left_limit) | (offsets < right_limit)
    return masked


def blocked_sectors(
    cells: Cells, before: bytes, radii_m: tuple[float, float, float], target_m: float, config: FollowValleyConfig
) -> tuple[Sectors, Sectors, Sectors]:
    """Return the blocked sectors, those that pass something near, and those that the robot cannot even just pass.

    A sector is blocked if the disc cannot drive one way, or was blocked and the disc cannot drive a longer way.

    Parameters
    ----------
    cells : Cells
        Around the robot, at least as far as it looks.
    before : bytes
        The blocked sectors before, a byte each.
    radii_m : tuple of float
        Of the disc that is driven, of the one for which there is room where nothing is near, and of the least, m.
    target_m : float
        What lies farther than the target does not block, m.
    config : FollowValleyConfig
        The two ways for a sure cell; an uncertain one blocks a part of them.
    """
    block_m = min(config.block_m, target_m)
    radius_m, comfort_m, least_m = radii_m
    ways_m = (block_m, min(config.free_m, target_m), block_m, block_m)
    blocks, keeps, near, closed = crossed(cells, (radius_m, radius_m, comfort_m, least_m), ways_m, in_part=True)
    return blocks | (keeps & np.frombuffer(before, dtype=np.bool_)), near, closed
