"""The binary polar histogram of VFH+: the directions in which something stands in the way.

After Ulrich & Borenstein, *VFH+: Reliable Obstacle Avoidance for Fast Mobile Robots*, ICRA 1998, in units: a cell's
magnitude is its certainty over its distance, so that both thresholds are distances at which a sure cell blocks. The
magnitudes of a sector are not summed, as the grid spreads one echo over the many cells of its arc.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from config.behaviors import FollowValleyConfig
from perception.percept import Floats, Percept

SECTORS: Final = 72
"""Sectors of 5°, numbered counter-clockwise; the first has its middle along the x axis of odometry."""
SECTOR_RAD: Final = math.tau / SECTORS
FIRM_M: Final = 0.02
"""The robot asks for this much less room than it has where it stands, m: what is beside it does not hold it."""

LINE: Final = 2 * SECTORS + 2
"""Places on a line twice round, on which runs of sectors are laid out."""

Sectors: TypeAlias = NDArray[np.bool_]
"""A flag for each sector, shape (SECTORS,) or, of several discs, (n, SECTORS)."""
ALL_FREE: Final = bytes(SECTORS)


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """What may stand in the way near a place.

    Attributes
    ----------
    dx, dy : (k,) float
        From the place to each occupied cell or fresh echo, m.
    distances : (k,) float
        Their lengths, m.
    certainties : (k,) float
        Above 0, and 1 for a sure cell and for an echo.
    """

    dx: Floats
    dy: Floats
    distances: Floats
    certainties: Floats


def cells_near(percept: Percept, x: float, y: float, reach_m: float, config: FollowValleyConfig) -> Cells:
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
    """
    window = percept.occupancy
    if window is None:
        table = np.empty((4, len(percept.obstacles)))
        cells = 0
    else:
        rows, columns = window.occupied.shape
        left, low = (x - window.x_m) / window.cell_m, (y - window.y_m) / window.cell_m
        reach = reach_m / window.cell_m
        column, row = max(0, int(left - reach)), max(0, int(low - reach))
        part = window.occupied[
            row : max(row, min(rows, int(low + reach) + 1)), column : max(column, min(columns, int(left + reach) + 1))
        ]
        at_row, at_column = (part > config.occupied_probability).nonzero()
        cells = len(at_row)
        table = np.empty((4, cells + len(percept.obstacles)))
        np.add(at_column, column + 0.5 - left, out=table[0, :cells])
        np.add(at_row, row + 0.5 - low, out=table[1, :cells])
        table[:2, :cells] *= window.cell_m
        sure = np.subtract(part[at_row, at_column], np.float64(config.occupied_probability), out=table[3, :cells])
        sure /= config.sure_probability - config.occupied_probability
        np.minimum(sure, 1.0, out=sure)
    np.subtract(percept.obstacles.T, ((x,), (y,)), out=table[:2, cells:])
    table[3, cells:] = 1.0
    distances = np.hypot(table[0], table[1], out=table[2])
    return Cells(*table.compress(distances < reach_m, axis=1))


def heard_at(cells: Cells, place: tuple[float, float], radius_m: float, percept: Percept) -> Cells:
    """Return the cells and fresh echoes, near a place the fresh echoes alone.

    Parameters
    ----------
    cells : Cells
        Around the robot, from `cells_near`.
    place : tuple of float
        Seen from the robot in odometry's directions, m.
    radius_m : float
        What is nearer to the place is left out, m.
    percept : Percept
        Its pose and its echoes.
    """
    away = np.hypot(cells.dx - place[0], cells.dy - place[1]) >= radius_m
    fresh = percept.obstacles - (percept.pose.x, percept.pose.y)
    fresh = fresh[np.hypot(fresh[:, 0] - place[0], fresh[:, 1] - place[1]) < radius_m]
    return Cells(
        np.append(cells.dx[away], fresh[:, 0]), np.append(cells.dy[away], fresh[:, 1]),
        np.append(cells.distances[away], np.hypot(fresh[:, 0], fresh[:, 1])),
        np.append(cells.certainties[away], np.ones(len(fresh))),
    )  # fmt: skip


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


def crossed(cells: Cells, radii_m: Floats, ways_m: Floats, shares: Floats | None = None) -> Sectors:
    """Return the sectors along whose middle a disc cannot drive some way without touching a cell.

    Several discs at once cost hardly more than one.

    Parameters
    ----------
    cells : Cells
        The cells.
    radii_m : (n,) float
        Of the discs, m.
    ways_m : (n,) float
        Their ways, m. A cell beside a way's end blocks fewer directions than one that is passed.
    shares : (k,) float, optional
        What share of the ways each cell blocks; 1 if not given.

    Returns
    -------
    Sectors
        Shape (n, SECTORS).
    """
    discs = len(radii_m)
    ends = radii_m + ways_m if shares is None else radii_m + np.multiply.outer(shares, ways_m)
    cell, disc = (cells.distances[:, None] < ends).nonzero()
    if len(cell) == 0:
        return np.zeros((discs, SECTORS), dtype=np.bool_)
    radii, ways = radii_m[disc], ways_m[disc]
    d = np.maximum(cells.distances[cell], radii + 1e-9)
    squares, corners = d * d, (ways_m * ways_m + radii_m * radii_m)[disc]
    # Passed on the way: asin(R/d), the enlargement of VFH+. Beside its end: the law of cosines.
    beside = (squares > corners).nonzero()[0]
    half = np.arcsin(radii / d)
    if len(beside):
        way, radius, far = ways[beside], radii[beside], d[beside]
        cosines = (squares[beside] + (way * way - radius * radius)) / (2.0 * way * far)
        half[beside] = np.arccos(np.minimum(cosines, 1.0))
    half *= 1.0 / SECTOR_RAD
    middle = (np.arctan2(cells.dy, cells.dx) / SECTOR_RAD)[cell]
    # Each run adds 1 where it begins and takes it away behind its end, on a line twice round for each disc; a run
    # without a sector ends before it begins, and adds nothing.
    middle += disc * LINE + SECTORS
    begins = np.bincount(np.ceil(middle - half).astype(np.intp), minlength=discs * LINE)
    ends_at = np.bincount(np.floor(middle + half).astype(np.intp) + 1, minlength=discs * LINE)
    counts = (begins - ends_at).cumsum().reshape(discs, LINE) > 0
    covered: Sectors = counts[:, :SECTORS] | counts[:, SECTORS : 2 * SECTORS]
    covered[:, 0] |= counts[:, 2 * SECTORS]
    return covered


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
    radii = np.array([radius_m, radius_m, comfort_m, least_m])
    ways = np.array([block_m, min(config.free_m, target_m), block_m, block_m])
    blocks, keeps, near, closed = crossed(cells, radii, ways, cells.certainties)
    return blocks | (keeps & np.frombuffer(before, dtype=np.bool_)), near, closed
