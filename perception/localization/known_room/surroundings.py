"""The surfaces of a known room near one place, nearest first, and the range that a sensor there should read.

The kernels compute what `perception.localization.room.expected_ranges` computes on numpy's arrays, one sensor at a
time. The order of the surfaces ends each search at the first one that is farther away than what is already found.
"""

from __future__ import annotations

import math
from typing import Annotated, Final, NamedTuple

import numpy as np

from perception.bayes.memory.polygon_parameters import EDGE_REACH_M
from perception.kernel import Floats, Ints, kernel
from perception.localization.known_room.surface_index import CIRCLES, CORNERS, WALLS, Bins, listed, make_index
from perception.localization.room.expected_ranges import SIGHT_SLACK_M
from perception.localization.room.range_likelihood import RangeModel
from perception.localization.room.room import Room
from perception.records import Record, Records, records, zeros

FRINGE_RAD: Final = math.radians(6.0)
"""So far beside the beam a mirror may still answer, where it is not quite smooth or the beam's edge is not sharp."""
NEAR_MAX: Final = 256
"""Walls, corners and circles near a place: the nearest ones."""


Expected = tuple[float, float, float]
"""An expected range (m; inf for silence), and its derivative by the sensor's x and y."""


class Wall(Record):
    """As in `Room`: both ends, the unit normal, and normal · point."""

    x1: float
    y1: float
    x2: float
    y2: float
    nx: float
    ny: float
    offset: float


class Corner(Record):
    """As in `Room`: a sector between two walls, from a direction counter-clockwise."""

    x: float
    y: float
    start: float
    opening: float


class Circle(Record):
    """As in `Room`."""

    x: float
    y: float
    radius: float


class Near(Record):
    """What is near a place: indices and distances from the place (m), ascending."""

    x: float
    y: float
    wall_count: int
    corner_count: int
    circle_count: int
    walls: Annotated[Ints, NEAR_MAX]
    wall_m: Annotated[Floats, NEAR_MAX]
    corners: Annotated[Ints, NEAR_MAX]
    corner_m: Annotated[Floats, NEAR_MAX]
    circles: Annotated[Ints, NEAR_MAX]
    circle_m: Annotated[Floats, NEAR_MAX]


class SensorModel(Record):
    """The beam, and the errors of a range as in `RangeModel`."""

    half_angle: float
    cos_half: float
    cos_fringe: float
    """Of the half opening with the fringe."""
    tan_half: float
    window_m: float
    variance: float
    """Of a range, without the part that grows with it, m²."""
    noise_relative: float
    dropout: float
    outliers: float


class Surroundings(NamedTuple):
    """What kernels take: the room, its index, what is near a place in it, and the sensor's model."""

    walls: Records[Wall]
    corners: Records[Corner]
    circles: Records[Circle]
    bins: Records[Bins]
    starts: Ints
    items: Ints
    near: Records[Near]
    sensor: Records[SensorModel]


def make_surroundings(room: Room, model: RangeModel, half_angle: float) -> Surroundings:
    """Return the surfaces of a room as kernels take them, with nothing near yet.

    Parameters
    ----------
    room : Room
        The surfaces.
    model : RangeModel
        Errors of a range.
    half_angle : float
        Half the beam's opening, rad.
    """
    walls, corners = zeros(Wall, len(room.walls)), zeros(Corner, len(room.corners))
    circles = zeros(Circle, len(room.circles))
    columns = np.column_stack([room.walls, room.normals, room.offsets])
    for array, rows in ((walls, columns), (corners, room.corners), (circles, room.circles)):
        for name, values in zip(array.dtype.names or (), rows.T, strict=True):
            array[name] = values
    sensor = zeros(SensorModel, 1)
    sensor[0] = (
        half_angle, math.cos(half_angle), math.cos(half_angle + FRINGE_RAD), math.tan(half_angle), model.window_m,
        model.resolution_m**2 / 12.0 + model.noise_m**2, model.noise_relative, model.dropout, model.outliers,
    )  # fmt: skip
    bins, starts, items = make_index(room, model.window_m)
    return Surroundings(
        records(Wall, walls), records(Corner, corners), records(Circle, circles), records(Bins, bins), starts, items,
        records(Near, zeros(Near, 1)), records(SensorModel, sensor),
    )  # fmt: skip


@kernel
def insert_nearest(indices: Ints, distances: Floats, count: int, index: int, distance: float) -> int:
    """Insert an index into a list in ascending order of distance, and return the list's new length.

    Parameters
    ----------
    indices : (n,) int
        The list; the farthest drops out where it is full.
    distances : (n,) float
        Of the indices.
    count : int
        Length of the list.
    index, distance : int, float
        To insert.
    """
    if count == len(indices):
        if distance >= distances[count - 1]:
            return count
        count -= 1
    at = count
    while at > 0 and distances[at - 1] > distance:
        indices[at], distances[at] = indices[at - 1], distances[at - 1]
        at -= 1
    indices[at], distances[at] = index, distance
    return count + 1


@kernel
def look_around(s: Surroundings, x: float, y: float, within_m: float) -> None:
    """Find the surfaces that sensors near a place can hear.

    Parameters
    ----------
    s : Surroundings
        Its `near` is updated.
    x, y : float
        The place, m.
    within_m : float
        Greatest distance of a sensor from it, m.
    """
    near, reach = s.near[0], within_m + s.sensor[0].window_m
    near.x, near.y = x, y
    count = 0
    begin, end = listed(s.bins, s.starts, WALLS, x, y, within_m)
    for k in range(end - begin if begin >= 0 else len(s.walls)):
        i = s.items[begin + k] if begin >= 0 else k
        wall = s.walls[i]
        vx, vy = wall.x2 - wall.x1, wall.y2 - wall.y1
        share = ((x - wall.x1) * vx + (y - wall.y1) * vy) / (vx * vx + vy * vy)
        share = min(1.0, max(0.0, share))
        away = math.hypot(x - wall.x1 - share * vx, y - wall.y1 - share * vy)
        if away <= reach:
            count = insert_nearest(near.walls, near.wall_m, count, i, away)
    near.wall_count = count
    count = 0
    begin, end = listed(s.bins, s.starts, CORNERS, x, y, within_m)
    for k in range(end - begin if begin >= 0 else len(s.corners)):
        i = s.items[begin + k] if begin >= 0 else k
        corner = s.corners[i]
        away = math.hypot(corner.x - x, corner.y - y)
        if away <= (reach if corner.opening < math.pi else within_m + EDGE_REACH_M):
            count = insert_nearest(near.corners, near.corner_m, count, i, away)
    near.corner_count = count
    count = 0
    begin, end = listed(s.bins, s.starts, CIRCLES, x, y, within_m)
    for k in range(end - begin if begin >= 0 else len(s.circles)):
        i = s.items[begin + k] if begin >= 0 else k
        circle = s.circles[i]
        away = math.hypot(circle.x - x, circle.y - y) - circle.radius
        if away <= reach:
            count = insert_nearest(near.circles, near.circle_m, count, i, away)
    near.circle_count = count


@kernel
def way_into(circle_x: float, circle_y: float, radius: float, ux: float, uy: float) -> float:
    """Return how far a ray along a unit vector runs until it enters a circle, m; inf if never.

    Parameters
    ----------
    circle_x, circle_y, radius : float
        The circle, relative to the ray's begin, m.
    ux, uy : float
        The vector.
    """
    off = circle_x * uy - circle_y * ux
    if abs(off) >= radius:
        return math.inf
    into = circle_x * ux + circle_y * uy - math.sqrt(radius * radius - off * off)
    return into if into > 0.0 else math.inf


@kernel
def is_surface_hidden(s: Surroundings, x: float, y: float, dx: float, dy: float) -> bool:
    """Return whether a surface near the place crosses the line of sight from (x, y) to (x + dx, y + dy), m."""
    near = s.near[0]
    length, off = math.hypot(dx, dy), math.hypot(x - near.x, y - near.y)
    if length <= SIGHT_SLACK_M:
        return False
    end = 1.0 - SIGHT_SLACK_M / length
    for k in range(near.wall_count):
        if near.wall_m[k] - off >= length:
            break
        wall = s.walls[near.walls[k]]
        ax, ay, bx, by = wall.x1 - x, wall.y1 - y, wall.x2 - x, wall.y2 - y
        side_a, side_b = dx * ay - dy * ax, dx * by - dy * bx
        if side_a * side_b <= 0.0 and side_a != side_b:
            share = (ax * (by - ay) - ay * (bx - ax)) / (side_b - side_a)
            if 0.0 < share < end:
                return True
    for k in range(near.circle_count):
        if near.circle_m[k] - off >= length:
            break
        circle = s.circles[near.circles[k]]
        if way_into(circle.x - x, circle.y - y, circle.radius, dx / length, dy / length) < length - SIGHT_SLACK_M:
            return True
    return False


@kernel
def expect_cone(s: Surroundings, x: float, y: float, cos: float, sin: float) -> tuple[float, float, float]:
    """Return the distance (m) of the nearest point in a beam, and its derivative by the sensor's x and y.

    Parameters
    ----------
    s : Surroundings
        Of a place near the sensor.
    x, y, cos, sin : float
        The sensor's place, m, and axis.

    Returns
    -------
    tuple of float
        inf, 0, 0 for silence.
    """
    near, slope = s.near[0], s.sensor[0].tan_half
    off = math.hypot(x - near.x, y - near.y)
    best, grad_x, grad_y = math.inf, 0.0, 0.0
    for k in range(near.wall_count):
        if near.wall_m[k] - off > best:
            break
        wall = s.walls[near.walls[k]]
        ax, ay, vx, vy = wall.x1 - x, wall.y1 - y, wall.x2 - wall.x1, wall.y2 - wall.y1
        forward, left = cos * ax + sin * ay, cos * ay - sin * ax
        along, across = cos * vx + sin * vy, cos * vy - sin * vx
        low, high = 0.0, 1.0
        for side in (-1.0, 1.0):  # right of the beam's left edge, left of its right edge
            value, rate = slope * forward + side * left, slope * along + side * across
            if rate > 0.0:
                low = max(low, -value / rate)
            elif rate < 0.0:
                high = min(high, -value / rate)
            elif value < 0.0:
                high = -1.0
        if low > high:
            continue
        share = max(min(-(ax * vx + ay * vy) / (vx * vx + vy * vy), high), low)
        px, py = ax + share * vx, ay + share * vy
        distance = math.hypot(px, py)
        if distance < best:
            best, grad_x, grad_y = distance, 0.0, 0.0
            if distance > 0.0:
                ux, uy = px / distance, py / distance
                facing = wall.nx * ux + wall.ny * uy
                # At an end of the wall the point stays; else it slides along the wall, with the beam's edge.
                if share <= 0.0 or share >= 1.0:
                    grad_x, grad_y = -ux, -uy
                elif facing != 0.0:
                    grad_x, grad_y = -wall.nx / facing, -wall.ny / facing
    for k in range(near.circle_count):
        if near.circle_m[k] - off > best:
            break
        circle = s.circles[near.circles[k]]
        cx, cy = circle.x - x, circle.y - y
        centre = math.hypot(cx, cy)
        gap = centre - circle.radius
        if 0.0 < gap < best and cx * cos + cy * sin >= centre * s.sensor[0].cos_half:
            best, grad_x, grad_y = gap, -cx / centre, -cy / centre
        for side in (-1.0, 1.0):  # a sensor that moves keeps the edge's direction, so the point slides
            ux, uy = cos - side * slope * sin, sin + side * slope * cos
            length = math.hypot(ux, uy)
            ux, uy = ux / length, uy / length
            into = way_into(cx, cy, circle.radius, ux, uy)
            if into < best:
                nx, ny = into * ux - cx, into * uy - cy
                facing = nx * ux + ny * uy
                best, grad_x, grad_y = into, 0.0, 0.0
                if facing != 0.0:
                    grad_x, grad_y = -nx / facing, -ny / facing
    return best, grad_x, grad_y
