"""The shortest way of a round robot through a known world, with which drives through an unknown one compare."""

from __future__ import annotations

import math
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.world import WorldConfig

CELL_M: Final = 0.1
MARGIN_M: Final = 2.0
"""Room around the surfaces that the raster includes, m."""
MOVES: Final = tuple((i, j) for i in range(-2, 3) for j in range(-2, 3) if math.gcd(i, j) == 1)
"""Sixteen directions: a way along them is at most 2.7 % too long."""
Place = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class FreeSpace:
    """Where the centre of a robot may be.

    Attributes
    ----------
    free : (rows, columns) bool
        Whether the middle of a cell is far enough from every surface, row by row from the smallest y.
    x_m, y_m : float
        The middle of the first cell, m.
    """

    free: NDArray[np.bool_]
    x_m: float
    y_m: float

    def cell(self, place: Place) -> tuple[int, int]:
        """Return row and column of the cell nearest to a place."""
        rows, columns = self.free.shape
        row, column = round((place[1] - self.y_m) / CELL_M), round((place[0] - self.x_m) / CELL_M)
        return min(rows - 1, max(0, row)), min(columns - 1, max(0, column))

    def place(self, cell: tuple[int, int]) -> Place:
        """Return the middle of a cell, m."""
        return self.x_m + CELL_M * cell[1], self.y_m + CELL_M * cell[0]


def free_space(world: WorldConfig, room_m: float) -> FreeSpace:
    """Return where a disc fits between the surfaces of a world.

    Parameters
    ----------
    world : WorldConfig
        The world, with at least one surface.
    room_m : float
        Radius of the disc, m.
    """
    sides = np.array(world.sides_m(), dtype=np.float64).reshape(-1, 4)
    drums = np.array([(d.x_m, d.y_m, d.radius_m) for d in world.drum], dtype=np.float64).reshape(-1, 3)
    ends = np.concatenate([sides.reshape(-1, 2), drums[:, :2]])
    low, high = ends.min(axis=0) - MARGIN_M, ends.max(axis=0) + MARGIN_M
    columns, rows = (np.ceil((high - low) / CELL_M).astype(int) + 1).tolist()
    free = np.ones((rows, columns), dtype=np.bool_)
    xs, ys = low[0] + CELL_M * np.arange(columns), low[1] + CELL_M * np.arange(rows)
    for x1, y1, x2, y2 in sides.tolist():
        j, i = _span(xs, x1, x2, room_m), _span(ys, y1, y2, room_m)
        dx, dy = xs[None, j] - x1, ys[i, None] - y1
        ux, uy = x2 - x1, y2 - y1
        share = np.clip((dx * ux + dy * uy) / (ux * ux + uy * uy), 0.0, 1.0)
        free[i, j] &= np.hypot(dx - share * ux, dy - share * uy) >= room_m
    for x, y, radius in drums.tolist():
        j, i = _span(xs, x, x, room_m + radius), _span(ys, y, y, room_m + radius)
        free[i, j] &= np.hypot(xs[None, j] - x, ys[i, None] - y) >= room_m + radius
    return FreeSpace(free, float(low[0]), float(low[1]))


def _span(axis: NDArray[np.float64], a: float, b: float, room_m: float) -> slice:
    begin, end = np.searchsorted(axis, [min(a, b) - room_m, max(a, b) + room_m]).tolist()
    return slice(begin, end)


def shortest_way(space: FreeSpace, start: Place, goal: Place) -> list[Place] | None:
    """Return the shortest way between two places along the cells, by A*; None if there is none.

    Parameters
    ----------
    space : FreeSpace
        Where the robot fits.
    start, goal : tuple of float
        The places, m.
    """
    free, begin, end = space.free, space.cell(start), space.cell(goal)
    if not (free[begin] and free[end]):
        return None
    rows, columns = free.shape
    cost, parent, done = {begin: 0.0}, {begin: begin}, set[tuple[int, int]]()
    heap = [(math.dist(begin, end), begin)]
    while heap:
        _, at = heappop(heap)
        if at in done:
            continue
        done.add(at)
        if at == end:
            way = [at]
            while way[-1] != begin:
                way.append(parent[way[-1]])
            return [space.place(cell) for cell in reversed(way)]
        for di, dj in MOVES:
            to = at[0] + di, at[1] + dj
            if not (0 <= to[0] < rows and 0 <= to[1] < columns and free[to]) or to in done:
                continue
            there = cost[at] + math.hypot(di, dj)
            if there < cost.get(to, math.inf):
                cost[to], parent[to] = there, at
                heappush(heap, (there + math.dist(to, end), to))
    return None


def length_m(way: list[Place]) -> float:
    """Return the length of a way, m."""
    return sum(math.dist(a, b) for a, b in pairwise(way))
