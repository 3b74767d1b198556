"""Walls and the corners heard on them, fitted together."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.state import Memory
from perception.bayes.memory.wall_records import WallMap
from perception.bayes.walls.corners import clear_information, enter_echo, find_corners
from perception.bayes.walls.report import room_report
from tests import naive_walls
from tests.naive_walls import Array
from tests.perception.bayes.rooms import SIGMA, fill, new_room, place_wall, reading

VARIANCE_OFFSET, VARIANCE_SLOPE = 4e-6, 4e-4
"""Of a wall that is known in one place, m² and 1."""


def corner_of_two_walls() -> tuple[Memory, WallMap]:
    """Return two walls that would meet in (2, 2), the direction of each known to a degree."""
    memory, room = new_room()
    for k, normal in enumerate((0.0, math.pi / 2)):
        place_wall(room.walls[k], np.zeros(2), normal, 2.0)
    fill(memory, room.walls[0], -1.0, 1.5)
    fill(memory, room.walls[1], -1.5, 1.0)
    for wall in (room.walls[0], room.walls[1]):
        wall.variance_offset, wall.covariance, wall.variance_slope = VARIANCE_OFFSET, 0.0, VARIANCE_SLOPE
    find_corners(memory.s)
    return memory, room


def hear(room: WallMap, place: Array, sensors: Array) -> Array:
    """Let the first corner be heard from these sensors as if it were at a place; return the ranges, m."""
    ranges = np.hypot(*(place - sensors).T)
    corner = room.corners[0]
    clear_information(corner.heard)
    corner.echoes = 0.0
    for (x, y), range_m in zip(sensors.tolist(), ranges.tolist(), strict=True):
        enter_echo(room, corner, reading(x, y, math.pi / 4, range_m))
    return np.asarray(ranges)


def directions(segments: Array) -> Array:
    """Return the angles of the two walls' normals, rad."""
    dx, dy = segments["x2"] - segments["x1"], segments["y2"] - segments["y1"]
    return np.asarray(np.arctan2(-dx, dy))


def test_a_corner_that_is_heard_turns_its_walls() -> None:
    memory, room = corner_of_two_walls()
    sensors = np.array([[0.2, 0.1], [1.0, -0.4], [-0.3, 0.9], [0.5, 0.5]])
    ranges = hear(room, np.array([2.02, 1.99]), sensors)
    root = np.diag([VARIANCE_SLOPE**-0.5, VARIANCE_OFFSET**-0.5])
    change, corner = naive_walls.corner_and_lines(
        np.array([0.0, math.pi / 2]), np.full(2, 2.0), [root, root], sensors, ranges, SIGMA, np.array([2.0, 2.0])
    )
    segments, points = room_report(memory)
    assert directions(segments) == pytest.approx([change[0], math.pi / 2 + change[2]], abs=3e-4)
    assert abs(change[0]) > 0.003, "the corner matters"
    assert (points["x"][0], points["y"][0]) == pytest.approx(corner, abs=5e-4)
    assert (segments["variance_turn"] < 0.2 * VARIANCE_SLOPE).all()
    assert (segments["x2"][0], segments["y2"][0]) == pytest.approx(corner, abs=1e-3), "and the wall ends in it"


def test_a_corner_that_is_not_heard_or_lies_elsewhere_turns_no_wall() -> None:
    memory, room = corner_of_two_walls()
    still = pytest.approx([0.0, math.pi / 2], abs=1e-9)
    assert directions(room_report(memory)[0]) == still
    sensors = np.array([[0.2, 0.1], [1.0, -0.4], [-0.3, 0.9], [0.5, 0.5]])
    hear(room, np.array([2.02, 1.99]), sensors[:2])
    assert directions(room_report(memory)[0]) == still, "two echoes"
    hear(room, np.array([2.2, 1.8]), sensors)
    assert directions(room_report(memory)[0]) == still, "something else was heard there"
