"""The range that a sensor should read at a place in a room, by either model of reflection.

`cone`: the nearest point of a surface inside the beam. `specular`: the nearest foot of a perpendicular inside the
beam; a concave corner answers as well, a convex edge only from near, and what a surface hides is silent. Written on
numpy's arrays: one call serves all sensors at many poses.
"""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from perception.bayes.memory.polygon_parameters import EDGE_REACH_M
from perception.kernel import Floats
from perception.localization.room.room import JOIN_M, Room

Reflection = Literal["cone", "specular"]

SIGHT_SLACK_M: Final = JOIN_M
"""A wall nearer than this to a reflecting point does not hide it, m."""


def reflection_of(model: str) -> Reflection:
    """Return the model of reflection that comes nearest to a world's: rays in the beam are as good as all of it."""
    return "specular" if model == "specular" else "cone"


class Beams(NamedTuple):
    """Sensors in the map frame: place (m) and direction (rad), each an array of the same shape."""

    x: Floats
    y: Floats
    axis: Floats


class Expected(NamedTuple):
    """What the sensors should read, each an array of the sensors' shape."""

    range_m: Floats
    """Range, m; inf for silence."""
    grad_x: Floats
    """Its derivative by the sensor's place; 0 for silence."""
    grad_y: Floats


def expected_ranges(room: Room, beams: Beams, half_angle: float, reflection: Reflection) -> Expected:
    """Return the expected range of each sensor.

    Parameters
    ----------
    room : Room
        The surfaces; there may be none.
    beams : Beams
        The sensors.
    half_angle : float
        Half the beam's opening, rad, below π/2.
    reflection : str
        `cone` or `specular`.
    """
    flat = Beams(*(part.reshape(-1) for part in beams))
    expected = Expected(np.full(flat.x.shape, np.inf), np.zeros(flat.x.shape), np.zeros(flat.x.shape))
    if reflection == "specular" and len(room.walls) + len(room.circles):
        expected = _specular(room, flat, half_angle)
    if reflection == "cone" and len(room.walls):
        expected = _cone(room, flat, half_angle)
    if reflection == "cone" and len(room.circles):
        expected = _nearer(expected, _cone_of_circles(room, flat, half_angle))
    return Expected(*(part.reshape(beams.x.shape) for part in expected))


def crossed(room: Room, x: Floats, y: Floats, to_x: Floats, to_y: Floats, slack: float) -> NDArray[np.bool_]:
    """Return which lines of sight cross a surface.

    Parameters
    ----------
    room : Room
        The surfaces.
    x, y, to_x, to_y : (n,) float
        Beginning and end of each line, m.
    slack : float
        A surface crossed nearer than this to the end does not count, m.
    """
    dx, dy = to_x - x, to_y - y
    length = np.hypot(dx, dy)
    ax, ay = room.walls[:, 0] - x[:, None], room.walls[:, 1] - y[:, None]
    vx, vy = (room.walls[:, 2:] - room.walls[:, :2]).T
    side_a = dx[:, None] * ay - dy[:, None] * ax
    side_b = side_a + dx[:, None] * vy - dy[:, None] * vx
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (ax * vy - ay * vx) / (side_b - side_a)
        end = 1.0 - slack / length
    hit: NDArray[np.bool_] = (side_a * side_b <= 0.0) & (share > 0.0) & (share < end[:, None])
    blocked = np.asarray(hit.any(axis=1))
    if len(room.circles):
        with np.errstate(divide="ignore", invalid="ignore"):
            ux, uy = (dx / length)[:, None], (dy / length)[:, None]
        into = _way_into(room.circles, x, y, ux, uy)
        blocked |= (into < length[:, None] - slack).any(axis=1)
    return blocked


def _way_into(circles: Floats, x: Floats, y: Floats, ux: Floats, uy: Floats) -> Floats:
    """Return how far a ray from (x, y) along a unit vector runs until it enters each circle, m; inf if never."""
    cx, cy, radius = circles[:, 0] - x[:, None], circles[:, 1] - y[:, None], circles[:, 2]
    along, off = cx * ux + cy * uy, cx * uy - cy * ux
    into = along - np.sqrt(np.maximum(radius**2 - off**2, 0.0))
    return np.where((np.abs(off) < radius) & (into > 0.0), into, np.inf)


def _cone(room: Room, beams: Beams, half_angle: float) -> Expected:
    """Return range and gradient of the nearest point of a wall inside each of (n,) beams; the room has a wall."""
    cos, sin = np.cos(beams.axis)[:, None], np.sin(beams.axis)[:, None]
    slope = np.tan(half_angle)
    ax, ay = room.walls[:, 0] - beams.x[:, None], room.walls[:, 1] - beams.y[:, None]
    vx, vy = (room.walls[:, 2:] - room.walls[:, :2]).T
    forward, left = cos * ax + sin * ay, cos * ay - sin * ax
    along, across = cos * vx + sin * vy, cos * vy - sin * vx
    low, high = np.zeros_like(forward), np.ones_like(forward)
    with np.errstate(divide="ignore", invalid="ignore"):
        for value, rate in (
            (slope * forward - left, slope * along - across),  # right of the beam's left edge
            (slope * forward + left, slope * along + across),  # left of its right edge
        ):
            zero = -value / rate
            low = np.where(rate > 0.0, np.maximum(low, zero), low)
            high = np.where(rate < 0.0, np.minimum(high, zero), high)
            high = np.where((rate == 0.0) & (value < 0.0), -1.0, high)
    foot = -(ax * vx + ay * vy) / (vx * vx + vy * vy)
    share = np.maximum(np.minimum(foot, high), low)
    px, py = ax + share * vx, ay + share * vy
    distance = np.where(low <= high, np.hypot(px, py), np.inf)
    row = np.arange(len(distance))
    wall = distance.argmin(axis=1)
    best, at = distance[row, wall], share[row, wall]
    with np.errstate(divide="ignore", invalid="ignore"):
        ux, uy = px[row, wall] / best, py[row, wall] / best
        nx, ny = room.normals[wall].T
        facing = nx * ux + ny * uy
        # At an end of the wall the point stays where it is; else it slides along the wall, with the beam's edge.
        ends = (at <= 0.0) | (at >= 1.0)
        grad_x, grad_y = np.where(ends, -ux, -nx / facing), np.where(ends, -uy, -ny / facing)
    good = np.isfinite(best) & np.isfinite(grad_x) & np.isfinite(grad_y)
    return Expected(best, np.where(good, grad_x, 0.0), np.where(good, grad_y, 0.0))


def _cone_of_circles(room: Room, beams: Beams, half_angle: float) -> Expected:
    """Return range and gradient of the nearest point of a circle inside each of (n,) beams; the room has a circle."""
    px, py, gap = _fronts(room, beams.x[:, None], beams.y[:, None])
    in_beam = px * np.cos(beams.axis)[:, None] + py * np.sin(beams.axis)[:, None] >= gap * np.cos(half_angle)
    found = _nearest(px, py, np.where(in_beam, gap, np.inf))
    for off in (-half_angle, half_angle):
        # The beam's edge: a sensor that moves keeps the ray's direction, so the point slides along the circle.
        ux, uy = np.cos(beams.axis + off), np.sin(beams.axis + off)
        into = _way_into(room.circles, beams.x, beams.y, ux[:, None], uy[:, None])
        best = into.min(axis=1)
        x, y, _ = room.circles[into.argmin(axis=1)].T
        with np.errstate(invalid="ignore", divide="ignore"):
            nx, ny = beams.x + best * ux - x, beams.y + best * uy - y
            facing = nx * ux + ny * uy
            grad_x, grad_y = -nx / facing, -ny / facing
        good = np.isfinite(grad_x) & np.isfinite(grad_y)
        edge = Expected(best, np.where(good, grad_x, 0.0), np.where(good, grad_y, 0.0))
        found = _nearer(found, edge)
    return found


def _fronts(room: Room, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the nearest point of each circle from each place, dx and dy, and its distance, m; inf from inside."""
    cx, cy = room.circles[:, 0] - x, room.circles[:, 1] - y
    centre = np.hypot(cx, cy)
    gap = np.where(centre > room.circles[:, 2], centre - room.circles[:, 2], np.inf)
    with np.errstate(invalid="ignore"):
        share = np.where(np.isfinite(gap), gap / centre, 0.0)
    return cx * share, cy * share, gap


def _nearest(px: Floats, py: Floats, distance: Floats) -> Expected:
    """Return the nearest of the points (dx, dy) of each sensor, at these distances; inf is no point."""
    row, nearest = np.arange(len(distance)), distance.argmin(axis=1)
    best = distance[row, nearest]
    good = np.isfinite(best) & (best > 0.0)
    scale = np.where(good, 1.0 / np.where(good, best, 1.0), 0.0)
    return Expected(best, -px[row, nearest] * scale, -py[row, nearest] * scale)


def _nearer(one: Expected, other: Expected) -> Expected:
    """Return the nearer of two expectations, sensor by sensor."""
    first = one.range_m <= other.range_m
    return Expected(*(np.where(first, a, b) for a, b in zip(one, other, strict=True)))


def mirror_points(room: Room, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the points that reflect sound back to some places, whatever hides them.

    Parameters
    ----------
    room : Room
        The surfaces.
    x, y : (n,) float
        Places, m.

    Returns
    -------
    (float, float, float)
        Each point from the place, dx and dy, and its distance, m, shape (n, walls + corners + circles); the distance
        is inf where the wall, corner or circle reflects nothing back.
    """
    x, y = x[:, None], y[:, None]
    height = room.offsets - room.normals[:, 0] * x - room.normals[:, 1] * y
    foot_x, foot_y = height * room.normals[:, 0], height * room.normals[:, 1]
    begin_x, begin_y = room.walls[:, 0] - x - foot_x, room.walls[:, 1] - y - foot_y
    end_x, end_y = room.walls[:, 2] - x - foot_x, room.walls[:, 3] - y - foot_y
    on_wall = begin_x * end_x + begin_y * end_y <= 0.0
    corner_x, corner_y = room.corners[:, 0] - x, room.corners[:, 1] - y
    back = (np.arctan2(-corner_y, -corner_x) - room.corners[:, 2]) % (2.0 * np.pi)
    reach = np.hypot(corner_x, corner_y)
    answers = (back < room.corners[:, 3]) & ((room.corners[:, 3] < np.pi) | (reach <= EDGE_REACH_M))
    front_x, front_y, gap = _fronts(room, x, y)
    px, py = np.hstack([foot_x, corner_x, front_x]), np.hstack([foot_y, corner_y, front_y])
    return px, py, np.hstack([np.where(on_wall, np.abs(height), np.inf), np.where(answers, reach, np.inf), gap])


def _specular(room: Room, beams: Beams, half_angle: float) -> Expected:
    """Return range and gradient of the nearest mirror point of each of (n,) beams; see `mirror_points`."""
    px, py, distance = mirror_points(room, beams.x, beams.y)
    cos, sin = np.cos(beams.axis)[:, None], np.sin(beams.axis)[:, None]
    beam, point = np.nonzero(px * cos + py * sin >= distance * np.cos(half_angle))
    bx, by = beams.x[beam], beams.y[beam]
    hidden = crossed(room, bx, by, bx + px[beam, point], by + py[beam, point], SIGHT_SLACK_M)
    mirror = np.full_like(distance, np.inf)
    mirror[beam, point] = np.where(hidden, np.inf, distance[beam, point])
    return _nearest(px, py, mirror)
