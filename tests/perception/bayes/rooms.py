"""Walls and readings of a room that tests of the wall map share."""

from __future__ import annotations

import math

import numpy as np

from perception.bayes.inference.reservoir import copy_reading
from perception.bayes.memory.elements import Reading
from perception.bayes.memory.state import CircleTrack, Memory
from perception.bayes.memory.wall_records import IS_FREE, MAX_WALLS, Wall, WallMap
from perception.bayes.walls.bins import HALF
from perception.bayes.walls.fit import fit_walls
from perception.bayes.walls.report import room_report
from perception.records import records, zeros
from tests.naive_walls import Array
from tests.perception.bayes.random_tracks import P, S, new_memory

SIGMA = 0.01
"""Noise of the readings, m, and the noise that the map assumes."""


def new_room() -> tuple[Memory, WallMap]:
    """Return a memory without walls, and its wall map."""
    memory = new_memory()
    room = memory.state["room"][0]
    room.variance_m2, room.relative_variance = SIGMA**2, 0.0
    return memory, room


def reading(x: float, y: float, axis: float, range_m: float) -> Reading:
    """Return one reading, its axis given by its angle (rad)."""
    array = zeros(Reading, 1)
    array[0] = (x, y, math.cos(axis), math.sin(axis), range_m, 0.0, 0.0)
    return records(Reading, array)[0]


def keep(track: CircleTrack, echoes: list[Reading]) -> None:
    """Let a circle keep these echoes alone, at most as many as there are bearings."""
    for of in track.bins:
        of.count = 0
    for k, q in enumerate(echoes):
        copy_reading(q, track.bins[k].readings[0])
        track.bins[k].count = 1


def place_wall(wall: Wall, origin: Array, normal: float, offset: float = 0.0) -> None:
    """Give a wall its frame and line; it has no readings."""
    wall.origin_x, wall.origin_y = (float(v) for v in origin)
    wall.normal_x, wall.normal_y = math.cos(normal), math.sin(normal)
    wall.offset, wall.slope, wall.weight = offset, 0.0, 1.0
    wall.variance_offset, wall.covariance, wall.variance_slope = 1e-6, 0.0, 1e-6


def refit(memory: Memory, wall: Wall) -> None:
    """Fit a wall again."""
    wall.is_changed = 1
    fit_walls(memory.s, P, 0, MAX_WALLS, 1)


def fill(memory: Memory, wall: Wall, low: float, high: float, count: float = 5.0, distance: float = 1.0) -> None:
    """Put exact echoes of this distance into every bin of a wall from one position to another, and fit it."""
    for b in range(round(low / 0.06) + HALF, round(high / 0.06) + HALF):
        of = wall.bins[b]
        u = (b - HALF + 0.5) * 0.06
        of.weight, of.precision, of.is_held = count, count / SIGMA**2, 1
        of.offset_sum, of.range_sum = of.precision * wall.offset, of.precision * distance
        q = of.newest
        v = wall.offset - distance
        q.x = wall.origin_x + v * wall.normal_x - u * wall.normal_y
        q.y = wall.origin_y + v * wall.normal_y + u * wall.normal_x
        q.axis_x, q.axis_y, q.range_m = wall.normal_x, wall.normal_y, distance
    refit(memory, wall)


def spans(wall: Wall) -> Array:
    """Return the spans of a wall, shape (n, 2)."""
    parts = [wall.spans[k] for k in range(wall.span_count)]
    return np.array([(part.low, part.high) for part in parts]).reshape(-1, 2)


def facing(normal: float, rng: np.random.Generator) -> float:
    """Return the axis of a sensor whose beam contains a normal well inside."""
    return normal + float(rng.uniform(-0.8, 0.8)) * S.half_angle_rad


def remember_free(room: WallMap, rows: Array) -> None:
    """Make rows of x, y, axis (rad) and range (m) the recent readings, echoes that nothing explains."""
    for k, (x, y, axis, range_m) in enumerate(rows.tolist()):
        q = room.recent[k].reading
        q.x, q.y, q.axis_x, q.axis_y, q.range_m = x, y, math.cos(axis), math.sin(axis), range_m
        room.recent[k].is_free = IS_FREE
    room.recent_count = len(rows)


def wall_ends(memory: Memory) -> Array:
    """Return the ends x, y, x, y (m) of the walls that are sure, shape (n, 4)."""
    segments, _ = room_report(memory)
    return np.column_stack([segments[name] for name in ("x1", "y1", "x2", "y2")])
