"""A finished run's map as an occupancy image with its YAML, as ROS's map_server reads and writes them.

Free is where the robot has been, and what an echo's sound has passed, in the middle half of the beam; occupied is
what was recognised. All else is unknown.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from config.world import WorldConfig
from drivers.messages import Floats
from runtime.analysis.timeline import Echoes

RESOLUTION_M: Final = 0.05
MARGIN_M: Final = 0.5
"""Around everything that the image shows."""
BEFORE_ECHO_M: Final = 0.1
"""Nothing is known to be free this near an echo."""
BEAM_SHARE: Final = 0.5
"""Share of the beam whose sound counts."""
RAYS: Final = 9
"""Rays across that share of a beam."""
PASSES_MIN: Final = 2
"""Readings that must have passed a cell, so that one outlier frees nothing."""
BATCH: Final = 2000
"""Readings that are entered at once; bounds the memory."""
PIXELS_MAX: Final = 100_000_000
OCCUPIED, UNKNOWN, FREE = 0, 205, 254
"""Grey values of map_server."""


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyImage:
    """An image of the floor.

    Attributes
    ----------
    pixels : (rows, columns) uint8
        Grey values; the first row is the farthest in y.
    x_m, y_m : float
        The lower left corner, m.
    """

    pixels: NDArray[np.uint8]
    x_m: float
    y_m: float

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
            f"image: {path.name}\nmode: trinary\nresolution: {RESOLUTION_M}\n"
            f"origin: [{self.x_m:.3f}, {self.y_m:.3f}, 0.0]\n"
            "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
            encoding="utf-8",
        )
        return beside


def yaml_beside(path: Path) -> Path:
    """Return the path of the YAML that describes an image."""
    return path.with_suffix(".yaml")


def occupancy_image(
    world: WorldConfig, echoes: Echoes, half_angle_rad: float, way: Floats, body_radius_m: float
) -> OccupancyImage:  # fmt: skip
    """Return the image of a run.

    Parameters
    ----------
    world : WorldConfig
        What was recognised.
    echoes : (n,) record of `timeline.ECHO`
        Every reading.
    half_angle_rad : float
        Half the beam's width, rad.
    way : (n, 2) float
        Positions of the robot, m.
    body_radius_m : float
        The robot's radius, m.

    Raises
    ------
    ValueError
        It would have more than `PIXELS_MAX` pixels.
    """
    heard = echoes[np.isfinite(echoes["range_m"])]
    outlines = world_outlines(world)
    ends = [heard[axis] + heard["range_m"] * turn(heard["bearing"]) for axis, turn in (("x", np.cos), ("y", np.sin))]
    places = np.concatenate([np.zeros((1, 2)), way, np.column_stack(ends), *outlines])
    low, high = places.min(axis=0) - body_radius_m - MARGIN_M, places.max(axis=0) + body_radius_m + MARGIN_M
    columns, rows = (int(n) for n in np.ceil((high - low) / RESOLUTION_M))
    if rows * columns > PIXELS_MAX:
        raise ValueError(f"an image of {columns} × {rows} pixels is too large")
    passes = np.zeros((rows, columns), np.int32)
    for begin in range(0, len(heard), BATCH):
        _enter_passes(passes, heard[begin : begin + BATCH], low, half_angle_rad)
    _enter_way(passes, way - low, body_radius_m)
    pixels = np.where(passes >= PASSES_MIN, FREE, UNKNOWN).astype(np.uint8)
    for outline in outlines:
        cells = np.floor((_dense(outline) - low) / RESOLUTION_M).astype(np.int64)
        pixels[np.clip(cells[:, 1], 0, rows - 1), np.clip(cells[:, 0], 0, columns - 1)] = OCCUPIED
    return OccupancyImage(np.ascontiguousarray(pixels[::-1]), float(low[0]), float(low[1]))


def world_outlines(world: WorldConfig) -> list[Floats]:
    """Return the outlines of everything in a world as chains of points, each of shape (n, 2), m."""
    turn = np.linspace(0.0, 2.0 * math.pi, 49)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    drums = [(drum.x_m, drum.y_m) + drum.radius_m * circle for drum in world.drum]
    polygons = [np.array([*polygon.vertices_m, polygon.vertices_m[0]]) for polygon in world.polygon]
    walls = [np.array([(wall.x1_m, wall.y1_m), (wall.x2_m, wall.y2_m)]) for wall in world.wall]
    return [*drums, *polygons, *walls]


def _dense(chain: Floats) -> Floats:
    """Return points along a chain, at most half a pixel apart."""
    steps = 2.0 / RESOLUTION_M
    return np.concatenate(
        [np.linspace(a, b, 2 + int(steps * np.hypot(*(b - a)))) for a, b in itertools.pairwise(chain)]
    )


def _enter_passes(passes: NDArray[np.int32], heard: Echoes, low: Floats, half_angle_rad: float) -> None:
    """Count for each cell the readings whose sound has passed it."""
    edge = BEAM_SHARE * half_angle_rad
    length = heard["range_m"] - BEFORE_ECHO_M
    along = np.arange(0.0, float(length.max(initial=0.0)), RESOLUTION_M)
    reading, step = np.nonzero(along[None] < length[:, None])
    rows, columns = passes.shape
    seen = list[NDArray[np.int64]]()
    for turn in np.linspace(-edge, edge, RAYS).tolist():
        bearing = heard["bearing"][reading] + turn
        x = np.floor((heard["x"][reading] + along[step] * np.cos(bearing) - low[0]) / RESOLUTION_M).astype(np.int64)
        y = np.floor((heard["y"][reading] + along[step] * np.sin(bearing) - low[1]) / RESOLUTION_M).astype(np.int64)
        is_inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
        seen.append(((reading * rows + y) * columns + x)[is_inside])
    cells = np.unique(np.concatenate(seen)) % (rows * columns)  # once for each reading
    np.add.at(passes.reshape(-1), cells, 1)


def _enter_way(passes: NDArray[np.int32], way: Floats, radius_m: float) -> None:
    """Count the cells that the robot has covered as passed."""
    side = np.arange(-radius_m, radius_m + RESOLUTION_M, RESOLUTION_M)
    x, y = (part.reshape(-1) for part in np.meshgrid(side, side))
    disc = np.column_stack([x, y])[np.hypot(x, y) <= radius_m]
    stood = np.unique(np.floor(way / RESOLUTION_M).astype(np.int64), axis=0)
    cells = (stood[:, None] + np.floor(disc / RESOLUTION_M + 0.5).astype(np.int64)[None]).reshape(-1, 2)
    passes[cells[:, 1], cells[:, 0]] = PASSES_MIN
