"""A finished run's map as an occupancy image with its YAML, as ROS's map_server reads and writes them.

Occupied is what was recognised, and what the evidence grid holds for occupied, unless all surfaces were mapped: what
else it holds are strays then. Free is where the robot has been, and what the grid holds for free where a line of
sight has crossed it, a cell away from anything occupied. All else is unknown. The grid enters all readings of the run
once more: an echo that something recognised explains marks its contact only. Then they are entered again as lines of
sight, which end at what is known by then: so no beam of the first minute passes a wall found later.
"""

from __future__ import annotations

import itertools
import json
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.robot import RingConfig
from config.settings import GridConfig
from config.world import WorldConfig
from drivers.messages import Firing, Floats, Pose
from perception.percept import OccupancyWindow
from perception.shared_numbers import EVEN
from runtime.analysis.export.shapes import scans_of
from runtime.analysis.timeline import Echoes

RESOLUTION_M: Final = 0.05
MARGIN_M: Final = 0.5
"""Around everything that the image shows."""
CELL_M: Final = 0.1
"""Side of a cell of the evidence grid: two pixels."""
CELLS_MAX: Final = 2048
"""Greatest side of its window: 205 m."""
OCCUPIED_MIN: Final = 0.65
"""Probability from which on a cell is occupied, as map_server has it."""
FREE_MAX: Final = 0.196
"""Probability up to which it is free, as map_server has it."""
EXPLAINED_M: Final = 0.08
"""Greatest error of a range that something recognised explains."""
PIXELS_MAX: Final = 100_000_000
OCCUPIED, UNKNOWN, FREE = 0, 205, 254
"""Grey values of map_server."""


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyImage:
    """An image of the floor."""

    pixels: NDArray[np.uint8]
    """(rows, columns): grey values; the first row is the farthest in y."""
    x_m: float
    y_m: float
    """The lower left corner, m."""

    def write(self, path: Path) -> Path:
        """Write the image (PGM) and beside it the YAML; return the path of the YAML.

        Raises
        ------
        OSError
            One of them cannot be written.
        """
        rows, columns = self.pixels.shape
        path.write_bytes(b"P5\n%d %d\n255\n" % (columns, rows) + self.pixels.tobytes())
        beside = yaml_beside(path)
        beside.write_text(
            f"image: {_yaml_text(path.name)}\nmode: trinary\nresolution: {RESOLUTION_M}\n"
            f"origin: [{self.x_m:.3f}, {self.y_m:.3f}, 0.0]\n"
            f"negate: 0\noccupied_thresh: {OCCUPIED_MIN}\nfree_thresh: {FREE_MAX}\n",
            encoding="utf-8",
        )
        return beside


def _yaml_text(text: str) -> str:
    """Return a text for YAML, in quotes where it may mean something else without them."""
    return text if re.fullmatch(r"\w[\w.-]*\.pgm", text) else json.dumps(text, ensure_ascii=False)


def yaml_beside(path: Path) -> Path:
    """Return the path of the YAML that describes an image."""
    return path.with_suffix(".yaml")


def occupancy_image(
    world: WorldConfig,
    echoes: Echoes,
    ring: RingConfig,
    way: Floats,
    body_radius_m: float,
    method: str = GridConfig().method,
    surfaces_mapped: bool = False,
) -> OccupancyImage:
    """Return the image of a run.

    Parameters
    ----------
    world : WorldConfig
        What was recognised.
    echoes : (n,) record of `timeline.ECHO`
        Every reading.
    ring : RingConfig
        The sensors.
    way : (n, 2) float
        Positions of the robot, m.
    body_radius_m : float
        The robot's radius, m.
    method : str
        Of the evidence grid, as the settings name it; `directed` where they keep none.
    surfaces_mapped : bool
        Whether the world has everything that was heard, whatever its shape.

    Raises
    ------
    ValueError
        It would have more than `PIXELS_MAX` pixels, or its evidence grid more than `CELLS_MAX` cells along a side.
    """
    heard = echoes[np.isfinite(echoes["range_m"])]
    outlines = world_outlines(world)
    ends = [heard[axis] + heard["range_m"] * turn(heard["bearing"]) for axis, turn in (("x", np.cos), ("y", np.sin))]
    places = np.concatenate([np.zeros((1, 2)), way, np.column_stack(ends), *outlines])
    low, high = places.min(axis=0) - body_radius_m - MARGIN_M, places.max(axis=0) + body_radius_m + MARGIN_M
    low = np.floor(low / CELL_M) * CELL_M
    columns, rows = (int(n) for n in np.ceil((high - low) / RESOLUTION_M))
    if rows * columns > PIXELS_MAX:
        raise ValueError(f"an image of {columns} × {rows} pixels is too large")
    window = run_evidence(world, echoes, ring, low, high, method)
    pixels = np.full((rows, columns), UNKNOWN, np.uint8)
    probability = _pixels_of(window, low, rows, columns)
    stray, known = probability >= OCCUPIED_MIN, np.zeros((rows, columns), np.bool_)
    for outline in outlines:
        cells = np.floor((_dense(outline) - low) / RESOLUTION_M).astype(np.int64)
        known[np.clip(cells[:, 1], 0, rows - 1), np.clip(cells[:, 0], 0, columns - 1)] = True
    # A surface lies within a cell of where the grid holds it.
    pixels[(probability <= FREE_MAX) & ~_within(known | stray, CELL_M)] = FREE
    _enter_way(pixels, way - low, body_radius_m)
    pixels[known if surfaces_mapped else known | stray] = OCCUPIED
    return OccupancyImage(np.ascontiguousarray(pixels[::-1]), float(low[0]), float(low[1]))


def run_evidence(
    world: WorldConfig, echoes: Echoes, ring: RingConfig, low: Floats, high: Floats, method: str = GridConfig().method
) -> OccupancyWindow:
    """Return the evidence grid of all readings of a run; ½ where it is free and no line of sight has crossed.

    Arguments are as of `occupancy_image`; low and high corner span the rectangle that it has to hold, m.

    Raises
    ------
    ValueError
        It is too large.
    """
    from perception.mapping.grid.evidence_grid import EvidenceGrid

    cells = 2 ** math.ceil(math.log2(max(32.0, float((high - low).max()) / CELL_M + 1.0)))
    if cells > CELLS_MAX:
        raise ValueError(f"an evidence grid of {cells} × {cells} cells is too large")
    chosen = "directed" if method == "off" else method
    grid = EvidenceGrid(ring, GridConfig().model_copy(update={"method": chosen, "cells": cells, "cell_m": CELL_M}))
    grid.window.fix(*(0.5 * (low + high)).tolist())
    half_angle = math.radians(ring.beam_half_angle_deg)
    entered, explained, end = list[tuple[Firing, Floats, int]](), explained_bearings(world, echoes, half_angle), 0
    for scan in scans_of(echoes, ring):
        sensors, ranges = scan.rows["sensor"], np.full(len(ring.mounts), np.nan)
        ranges[sensors] = scan.rows["range_m"]
        begin, end = end, end + len(scan.rows)
        grid.bearings[:] = np.nan
        grid.bearings[sensors] = explained[begin:end]
        on_wheels = [row for row in scan.rows if row["sensor"] in ring.turning]
        theta = float(on_wheels[0]["bearing"]) - ring.mounts[on_wheels[0]["sensor"]][2] if on_wheels else scan.yaw
        firing = Firing(scan.t_s, Pose(scan.x, scan.y, theta), scan.yaw, ranges)
        grid.observe(firing)
        entered.append((firing, grid.bearings.copy(), grid.place))
    grid.know_slanting(slanting_answers(world, echoes[np.isnan(explained)], ring))
    x_m, y_m = (CELL_M * float(number) for number in grid.window.corner)
    occupied = grid.method.probability(None)
    holds = occupied > EVEN
    for outline in world_outlines(world):
        at = np.floor((_dense(outline) - (x_m, y_m)) / CELL_M).astype(np.int64)
        at = at[((at >= 0) & (at < cells)).all(axis=1)]
        holds[at[:, 1], at[:, 0]] = True
    crossed = grid.crossed_before(holds, entered)
    occupied[(occupied < EVEN) & ~crossed] = EVEN
    return OccupancyWindow(occupied, x_m, y_m, CELL_M)


def explained_bearings(world: WorldConfig, rows: Echoes, half_angle: float) -> Floats:
    """Return where in its beam each echo came from, rad from the axis; NaN where nothing in the world explains it.

    Drums answer from their near side, and walls from the foot of the perpendicular.
    """
    at = np.column_stack([rows["x"], rows["y"]])
    best, found = np.full(len(rows), EXPLAINED_M), np.full(len(rows), np.nan)
    for towards, radius_m in _contacts(world, at):
        off = _turned(np.arctan2(towards[:, 1], towards[:, 0]) - rows["bearing"])
        with np.errstate(invalid="ignore"):
            error = np.abs(rows["range_m"] - np.hypot(towards[:, 0], towards[:, 1]) + radius_m)
            better = (error < best) & (np.abs(off) <= half_angle)
        best[better], found[better] = error[better], off[better]
    return found


def _contacts(world: WorldConfig, at: Floats) -> Iterator[tuple[Floats, float]]:
    """Yield the way from each place to the middle or the foot of each surface, and its radius, m."""
    yield from (((drum.x_m, drum.y_m) - at, drum.radius_m) for drum in world.drum)
    for x1, y1, x2, y2 in itertools.chain.from_iterable(wall.pieces_m() for wall in world.wall):
        start, chord = np.array([x1, y1]), np.array([x2 - x1, y2 - y1])
        along = (at - start) @ chord / max(1e-12, float(chord @ chord))
        feet = start + np.outer(np.where((along >= 0.0) & (along <= 1.0), along, np.nan), chord)
        yield feet - at, 0.0


def slanting_answers(world: WorldConfig, rows: Echoes, ring: RingConfig) -> int:
    """Return what readings that nothing explains show of slanting walls, as of `Method.locate_echoes`.

    A wall whose foot lies outside the beam may answer from the beam's edge.
    """
    from perception.bayes.walls.contact import (
        EDGES_LEAD,
        EDGES_SHARE,
        END_MARGIN_M,
        MIRRORS_SILENCES,
        SLANTING_MIN_COS,
        WENT_ON_M,
    )

    half_angle = math.radians(ring.beam_half_angle_deg)
    heard = silent = 0
    for x1, y1, x2, y2 in itertools.chain.from_iterable(wall.pieces_m() for wall in world.wall):
        length = math.hypot(x2 - x1, y2 - y1)
        tx, ty = (x2 - x1) / max(1e-9, length), (y2 - y1) / max(1e-9, length)
        dx, dy = x1 - rows["x"], y1 - rows["y"]
        across = dy * tx - dx * ty  # to the line, positive along its normal (-ty, tx)
        side = np.where(across < 0.0, -1.0, 1.0)
        off = _turned(np.arctan2(side * tx, -side * ty) - rows["bearing"])
        beyond = np.abs(off) - half_angle  # from the beam's edge to the foot
        edge = rows["bearing"] + np.copysign(half_angle, off)
        with np.errstate(divide="ignore", invalid="ignore"):
            expected = np.abs(across) / np.cos(beyond)
            along = expected * (np.cos(edge) * tx + np.sin(edge) * ty) - dx * tx - dy * ty
            meets = (beyond > 0.0) & (np.cos(beyond) > SLANTING_MIN_COS) & (expected < ring.range_max_m)
            meets &= (along > END_MARGIN_M) & (along < length - END_MARGIN_M)
            error = rows["range_m"] - expected
        heard += int((meets & (np.abs(error) < EXPLAINED_M)).sum())
        silent += int((meets & (error > EXPLAINED_M + WENT_ON_M)).sum())
    if heard > EDGES_SHARE * silent + EDGES_LEAD:
        return 1
    return -1 if silent >= MIRRORS_SILENCES else 0


def _turned(angles: Floats) -> Floats:
    """Return angles from -π to π."""
    turned: Floats = np.mod(angles + math.pi, 2.0 * math.pi) - math.pi
    return turned


def _pixels_of(window: OccupancyWindow, low: Floats, rows: int, columns: int) -> NDArray[np.float32]:
    """Return the probability of each pixel."""
    corners = ((low[1] - window.y_m, rows), (low[0] - window.x_m, columns))
    cells = [((first + (np.arange(n) + 0.5) * RESOLUTION_M) / window.cell_m).astype(np.int64) for first, n in corners]
    return window.occupied[np.ix_(*cells)]


def world_outlines(world: WorldConfig) -> list[Floats]:
    """Return drums, and the sides of all else in a world, as chains of points, each of shape (n, 2), m."""
    turn = np.linspace(0.0, 2.0 * math.pi, 49)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    drums = [(drum.x_m, drum.y_m) + drum.radius_m * circle for drum in world.drum]
    return [*drums, *(np.array(side).reshape(2, 2) for side in world.sides_m())]


def _dense(chain: Floats) -> Floats:
    """Return points along a chain, at most half a pixel apart."""
    steps = 2.0 / RESOLUTION_M
    return np.concatenate(
        [np.linspace(a, b, 2 + int(steps * np.hypot(*(b - a)))) for a, b in itertools.pairwise(chain)]
    )


def _within(marked: NDArray[np.bool_], distance_m: float) -> NDArray[np.bool_]:
    """Return which pixels are this near to a marked one."""
    reach = round(distance_m / RESOLUTION_M)
    rows, columns = marked.shape
    wide, found = np.pad(marked, reach), np.zeros_like(marked)
    for i, j in itertools.product(range(-reach, reach + 1), repeat=2):
        if i * i + j * j <= reach * reach:
            found |= wide[reach + i : reach + i + rows, reach + j : reach + j + columns]
    return found


def _enter_way(pixels: NDArray[np.uint8], way: Floats, radius_m: float) -> None:
    """Free the pixels that the robot has covered."""
    side = np.arange(-radius_m, radius_m + RESOLUTION_M, RESOLUTION_M)
    x, y = (part.reshape(-1) for part in np.meshgrid(side, side))
    disc = np.column_stack([x, y])[np.hypot(x, y) <= radius_m]
    stood = np.unique(np.floor(way / RESOLUTION_M).astype(np.int64), axis=0)
    cells = (stood[:, None] + np.floor(disc / RESOLUTION_M + 0.5).astype(np.int64)[None]).reshape(-1, 2)
    pixels[cells[:, 1], cells[:, 0]] = FREE
