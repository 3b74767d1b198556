"""Search of the whole room: how well readings fit at every cell of a grid and every heading.

The expected range of each cell and direction is computed once, coarsely. A search then compares readings of a short
drive with this table, shifted and turned. It yields starts for a finer fit: places that a tree of segments would miss
where maps are large, walls short and echoes few.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.kernel import Floats
from perception.localization.expected_ranges import SIGHT_SLACK_M, Reflection, crossed, mirror_points, surfaces_near
from perception.localization.panorama import Panorama
from perception.localization.range_likelihood import HEARD_SHARE, RangeModel
from perception.localization.room import Room

CELL_M: Final = 0.2
DIRECTIONS: Final = 60
STEP_RAD: Final = 2.0 * math.pi / DIRECTIONS
BLOCK: Final = 16
"""Cells of a block's side: the unit in which the table is computed."""
SIGMA_M: Final = 0.12
SIGMA_SHARE: Final = 0.03
"""Standard deviation of a range from the table: of half a cell, and a share of the range."""
DROPOUT: Final = 0.3
OUTLIERS: Final = 0.2
"""Shares of expected echoes that are not heard, and of readings that are anything: the table knows no more."""
OUTSIDE: Final = np.float32(0.125)
"""Likelihood ratio of a reading that would be taken outside the table."""
FACTORS: Final = 8
"""Ratios that are multiplied before their logarithm is taken: neither too small nor too large for float32."""
SILENT: Final = 255
"""Code of silence in the table."""
STARTS_MAX: Final = 100


class PoseGrid:
    """The table of one room.

    Parameters
    ----------
    room : Room
        The surfaces.
    half_angle : float
        Half the beam's opening, rad.
    window_m : float
        Greatest range, m.
    clear_m : float
        The ring's centre is farther than this from any surface, m.
    """

    def __init__(self, room: Room, half_angle: float, window_m: float, clear_m: float) -> None:
        self._room, self._half_angle, self._window_m, self._clear_m = room, half_angle, window_m, clear_m
        low, high = room.bounds
        self.shape = tuple(max(1, math.ceil(side / CELL_M)) for side in (high - low).tolist())
        # Symmetric about the room's middle: the answers of a symmetric room are then exactly alike.
        self._origin = 0.5 * (low + high) - 0.5 * CELL_M * (np.array(self.shape) - 1.0)
        self._table = np.full((2, DIRECTIONS, *self.shape), SILENT, dtype=np.uint8)
        self._free = np.zeros(self.shape, dtype=np.bool_)
        self._building = self._build()

    def _build(self) -> Iterator[None]:
        """Fill the table block by block."""
        half_m = 0.5 * CELL_M * BLOCK
        for i in range(0, self.shape[0], BLOCK):
            for j in range(0, self.shape[1], BLOCK):
                block = (slice(i, i + BLOCK), slice(j, j + BLOCK))
                shape = self._free[block].shape
                cells = np.argwhere(np.ones(shape, dtype=np.bool_)) + np.array([i, j])
                middle_x, middle_y = (self._origin + CELL_M * np.array([i, j]) + half_m - 0.5 * CELL_M).tolist()
                room = surfaces_near(self._room, middle_x, middle_y, math.sqrt(2.0) * half_m, self._window_m)
                x, y = (self._origin + CELL_M * cells).T
                self._free[block] = (_clearance(room, x, y) > self._clear_m).reshape(shape)
                for k, ranges in enumerate((self._cone(room, x, y), self._specular(room, x, y))):
                    code = np.where(ranges <= self._window_m, ranges * (254.0 / self._window_m), SILENT)
                    self._table[(k, slice(None), *block)] = np.rint(code).reshape(DIRECTIONS, *shape)
                yield

    def _specular(self, room: Room, x: Floats, y: Floats) -> Floats:
        """Return the expected ranges of mirrors at some places, shape (directions, n)."""
        px, py, distance = mirror_points(room, x, y)
        cell, point = np.nonzero(distance <= self._window_m)
        px, py, distance = px[cell, point], py[cell, point], distance[cell, point]
        seen = ~crossed(room, x[cell], y[cell], x[cell] + px, y[cell] + py, SIGHT_SLACK_M)
        return self._nearest(len(x), cell[seen], px[seen], py[seen], distance[seen])

    def _cone(self, room: Room, x: Floats, y: Floats) -> Floats:
        """Return the distances of the nearest points in the beams at some places, shape (directions, n)."""
        px, py, distance = mirror_points(room, x, y)
        ends = room.walls.reshape(-1, 2)
        end_x, end_y = ends[:, 0] - x[:, None], ends[:, 1] - y[:, None]
        px, py = np.hstack([px, end_x]), np.hstack([py, end_y])
        distance = np.hstack([distance, np.hypot(end_x, end_y)])
        cell, point = np.nonzero(distance <= self._window_m)
        found = self._nearest(len(x), cell, px[cell, point], py[cell, point], distance[cell, point])
        rays = np.stack([_ray(room, x, y, theta) for theta in (STEP_RAD * np.arange(DIRECTIONS)).tolist()])
        edge = max(1, round(self._half_angle / STEP_RAD))
        return np.minimum(found, np.minimum(np.roll(rays, edge, axis=0), np.roll(rays, -edge, axis=0)))

    def _nearest(self, cells: int, cell: NDArray[np.int64], px: Floats, py: Floats, distance: Floats) -> Floats:
        """Return the nearest of the points that each cell has in each direction's beam, shape (directions, cells)."""
        nearest = np.full((DIRECTIONS, cells), np.inf)
        bearing = np.arctan2(py, px)
        width = math.ceil(self._half_angle / STEP_RAD)
        for off in range(-width, width + 1):
            direction = np.rint(bearing / STEP_RAD).astype(np.int64) + off
            in_beam = np.abs(direction * STEP_RAD - bearing) <= self._half_angle
            at = (direction[in_beam] % DIRECTIONS, cell[in_beam])
            np.minimum.at(nearest, at, distance[in_beam])
        return nearest

    def expected(self, reflection: Reflection) -> Floats:
        """Return the ranges of one model's table, m; inf for silence, shape (directions, cells, cells)."""
        for _ in self._building:
            pass
        codes = self._table[("cone", "specular").index(reflection)]
        return np.where(codes == SILENT, np.inf, codes * (self._window_m / 254.0))

    def places(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> Floats:
        """Return the middles of cells, m, shape (n, 2)."""
        return np.asarray(self._origin + CELL_M * np.column_stack([i, j]))

    def search(self, readings: Panorama, model: RangeModel, specular_share: float) -> Generator[None, None, Floats]:
        """Search step by step; return the poses of the frame of the readings that fit best, shape (n, 3).

        Parameters
        ----------
        readings : Panorama
            Of a short drive, in one frame; none is NaN.
        model : RangeModel
            For the window.
        specular_share : float
            Probability that a reading is from the specular model.
        """
        yield from self._building
        likely = self._likely(readings.range_m, model, specular_share)
        score = np.full((DIRECTIONS, *self.shape), -np.inf, dtype=np.float32)
        for h in range(DIRECTIONS):
            score[h][self._free] = self._score(h, readings, likely)[self._free]
            yield
        peaks = np.flatnonzero(_is_peak(score))
        best = peaks[np.argsort(-score.reshape(-1)[peaks], kind="stable")[:STARTS_MAX]]
        heading, i, j = np.unravel_index(best, score.shape)
        return np.column_stack([self.places(i, j), heading * STEP_RAD])

    def _likely(self, measured: Floats, model: RangeModel, specular_share: float) -> NDArray[np.float32]:
        """Return each reading's likelihood ratio at each code of either model's table, shape (n, 2, 256)."""
        expected = np.append(np.arange(SILENT) * (self._window_m / 254.0), np.inf)
        sigma = np.hypot(SIGMA_M, SIGMA_SHARE * np.minimum(expected, self._window_m))
        heard = np.isfinite(measured)[:, None]
        with np.errstate(invalid="ignore"):
            error = (np.where(heard, measured[:, None], 0.0) - expected) / sigma
        echo = (1.0 - DROPOUT - OUTLIERS) / (sigma * math.sqrt(2.0 * math.pi)) * np.exp(-0.5 * error**2)
        echo = np.where(np.isfinite(expected), echo, 0.0) + OUTLIERS / model.window_m
        silent = np.where(np.isfinite(expected), DROPOUT, 1.0 - OUTLIERS)
        ratio = np.where(heard, echo / (HEARD_SHARE / model.window_m), silent / (1.0 - HEARD_SHARE))
        return np.stack([(1.0 - specular_share) * ratio, specular_share * ratio], axis=1).astype(np.float32)

    def _score(self, h: int, readings: Panorama, likely: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the summed log ratio of the readings at each cell with heading number h."""
        theta = STEP_RAD * h
        c, s = math.cos(theta), math.sin(theta)
        shift_i = np.rint((c * readings.x - s * readings.y) / CELL_M).astype(int).tolist()
        shift_j = np.rint((s * readings.x + c * readings.y) / CELL_M).astype(int).tolist()
        axis = np.rint((theta + readings.axis) / STEP_RAD).astype(int) % DIRECTIONS
        total, product = np.zeros(self.shape, dtype=np.float32), np.ones(self.shape, dtype=np.float32)
        for n, (di, dj, d) in enumerate(zip(shift_i, shift_j, axis.tolist(), strict=True)):
            (to_i, from_i), (to_j, from_j) = _slices(di, self.shape[0]), _slices(dj, self.shape[1])
            cone, specular = self._table[0, d, from_i, from_j], self._table[1, d, from_i, from_j]
            product *= OUTSIDE
            product[to_i, to_j] *= (likely[n, 0][cone] + likely[n, 1][specular]) * (1.0 / OUTSIDE)
            if n % FACTORS == FACTORS - 1:
                total += np.log(product)
                product[...] = 1.0
        return total + np.log(product)


def _slices(shift: int, size: int) -> tuple[slice, slice]:
    """Return which cells of a row have a cell so far on, and those cells."""
    shift = max(-size, min(size, shift))
    return slice(max(0, -shift), size - max(0, shift)), slice(max(0, shift), size - max(0, -shift))


def _ray(room: Room, x: Floats, y: Floats, theta: float) -> Floats:
    """Return how far a ray from each place in one direction runs until it meets a surface, m; inf if never."""
    ux, uy = math.cos(theta), math.sin(theta)
    best = np.full(x.shape, np.inf)
    if len(room.walls):
        vx, vy = (room.walls[:, 2:] - room.walls[:, :2]).T
        ax, ay = room.walls[:, 0] - x[:, None], room.walls[:, 1] - y[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = 1.0 / (ux * vy - uy * vx)
            share, way = (uy * ax - ux * ay) * slope, (ax * vy - ay * vx) * slope
            best = np.where((share >= 0.0) & (share <= 1.0) & (way > 0.0), way, np.inf).min(axis=1)
    for cx, cy, radius in room.circles.tolist():
        along, off = (cx - x) * ux + (cy - y) * uy, (cx - x) * uy - (cy - y) * ux
        into = along - np.sqrt(np.maximum(radius**2 - off**2, 0.0))
        best = np.minimum(best, np.where((np.abs(off) < radius) & (into > 0.0), into, np.inf))
    return best


def _clearance(room: Room, x: Floats, y: Floats) -> Floats:
    """Return the distance of places from the nearest surface, m; negative inside a circle."""
    best = np.full(x.shape, np.inf)
    for x1, y1, x2, y2 in room.walls.tolist():
        along_x, along_y = x2 - x1, y2 - y1
        share = np.clip(((x - x1) * along_x + (y - y1) * along_y) / (along_x**2 + along_y**2), 0.0, 1.0)
        best = np.minimum(best, np.hypot(x - x1 - share * along_x, y - y1 - share * along_y))
    for cx, cy, radius in room.circles.tolist():
        best = np.minimum(best, np.hypot(x - cx, y - cy) - radius)
    return best


def _is_peak(score: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return which poses fit at least as well as all their neighbours in place and heading."""
    best = np.maximum(score, np.maximum(np.roll(score, 1, axis=0), np.roll(score, -1, axis=0)))
    for axis in (1, 2):
        padded = np.pad(best, [(1, 1) if k == axis else (0, 0) for k in range(3)], constant_values=-np.inf)
        middle = np.moveaxis(padded, axis, 0)
        best = np.moveaxis(np.maximum(np.maximum(middle[:-2], middle[1:-1]), middle[2:]), 0, axis)
    return np.asarray((score >= best) & np.isfinite(score))
