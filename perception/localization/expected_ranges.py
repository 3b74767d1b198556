"""The range that a sensor should read at a place in a room, by either model of reflection.

`cone`: the nearest point of a wall inside the beam. `specular`: the nearest foot of a perpendicular inside the beam;
a concave corner answers as well, a convex edge only from near, and what a wall hides is silent. Written on numpy's
arrays: one call serves all sensors at many poses.
"""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from perception.kernel import Floats
from perception.localization.room import Room

Reflection = Literal["cone", "specular"]

EDGE_REACH_M: Final = 1.0
"""Farthest distance at which a convex edge is expected to answer, m."""
SIGHT_SLACK_M: Final = 1e-3
"""A wall nearer than this to a reflecting point does not hide it, m."""


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
        The walls.
    beams : Beams
        The sensors.
    half_angle : float
        Half the beam's opening, rad, below π/2.
    reflection : str
        `cone` or `specular`.
    """
    flat = Beams(*(part.reshape(-1) for part in beams))
    expected = _cone(room, flat, half_angle) if reflection == "cone" else _specular(room, flat, half_angle)
    return Expected(*(part.reshape(beams.x.shape) for part in expected))


def crossed(room: Room, x: Floats, y: Floats, to_x: Floats, to_y: Floats, slack: float) -> NDArray[np.bool_]:
    """Return which lines of sight cross a wall.

    Parameters
    ----------
    room : Room
        The walls.
    x, y, to_x, to_y : (n,) float
        Beginning and end of each line, m.
    slack : float
        A wall crossed nearer than this to the end does not count, m.
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
    return np.asarray(hit.any(axis=1))


def _cone(room: Room, beams: Beams, half_angle: float) -> Expected:
    """Return the distance of the nearest point of a wall inside each beam; see `expected_ranges`."""
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
    wall = distance.argmin(axis=1)
    row = np.arange(len(wall))
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


def _specular(room: Room, beams: Beams, half_angle: float) -> Expected:
    """Return the distance of the nearest mirror point of each beam; see `expected_ranges`."""
    x, y = beams.x[:, None], beams.y[:, None]
    height = room.offsets - room.normals[:, 0] * x - room.normals[:, 1] * y
    foot_x, foot_y = height * room.normals[:, 0], height * room.normals[:, 1]
    begin_x, begin_y = room.walls[:, 0] - x - foot_x, room.walls[:, 1] - y - foot_y
    end_x, end_y = room.walls[:, 2] - x - foot_x, room.walls[:, 3] - y - foot_y
    on_wall = begin_x * end_x + begin_y * end_y <= 0.0
    corner_x, corner_y = room.corners[:, 0] - x, room.corners[:, 1] - y
    back = (np.arctan2(-corner_y, -corner_x) - room.corners[:, 2]) % (2.0 * np.pi)
    reach = np.hypot(corner_x, corner_y)
    answers = (back < room.corners[:, 3]) & ((room.corners[:, 3] < np.pi) | (reach <= EDGE_REACH_M))

    px, py = np.hstack([foot_x, corner_x]), np.hstack([foot_y, corner_y])
    distance = np.hstack([np.abs(height), reach])
    cos, sin = np.cos(beams.axis)[:, None], np.sin(beams.axis)[:, None]
    in_beam = px * cos + py * sin >= distance * np.cos(half_angle)
    beam, point = np.nonzero(np.hstack([on_wall, answers]) & in_beam)
    bx, by = beams.x[beam], beams.y[beam]
    hidden = crossed(room, bx, by, bx + px[beam, point], by + py[beam, point], SIGHT_SLACK_M)
    mirror = np.full_like(distance, np.inf)
    mirror[beam, point] = np.where(hidden, np.inf, distance[beam, point])
    nearest = mirror.argmin(axis=1)
    row = np.arange(len(nearest))
    best = mirror[row, nearest]
    good = np.isfinite(best) & (best > 0.0)
    scale = np.where(good, 1.0 / np.where(good, best, 1.0), 0.0)
    return Expected(best, -px[row, nearest] * scale, -py[row, nearest] * scale)
