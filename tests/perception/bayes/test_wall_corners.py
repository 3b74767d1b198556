"""Corners of walls, against the solution of two equations."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes import wall_corners
from perception.bayes.wall_map import enter_corners
from tests import naive_walls
from tests.perception.bayes.rooms import fill, new_room, place_wall, reading
from tests.perception.bayes.tracks import P, examples


@examples(30, 300)
def test_walls_that_end_near_their_crossing_have_a_corner_there(examples: int) -> None:
    rng = np.random.default_rng(46)
    _, room = new_room()
    first, second = room.walls[0], room.walls[1]
    for _ in range(examples):
        a, turn = rng.uniform(-3, 3), rng.uniform(0.2, 2.5)
        place = rng.uniform(-1, 1, 2)
        for wall, normal in ((first, a), (second, a + turn)):
            place_wall(wall, place, normal, float(rng.uniform(0.5, 1.5)))
        normals = [np.array([math.cos(v), math.sin(v)]) for v in (a, a + turn)]
        point = naive_walls.crossing(
            normals[0],
            float(normals[0] @ place) + first.offset,
            normals[1],
            float(normals[1] @ place) + second.offset,
        )
        feet = [float(np.array([-n[1], n[0]]) @ (point - place)) for n in normals]
        for wall, foot in zip((first, second), feet, strict=True):
            wall.span_count, wall.spans[0].low, wall.spans[0].high = 1, foot + 0.3, foot + 2.0
        is_corner, *found = wall_corners.crossing(first, second)
        assert is_corner == (math.sin(turn) > 0.4)
        if is_corner:
            assert found == pytest.approx(point, abs=1e-9)
        second.spans[0].low = feet[1] - 1.0
        assert not wall_corners.crossing(first, second)[0]


def test_a_corner_keeps_its_echoes_while_its_walls_last() -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    place_wall(room.walls[1], np.zeros(2), math.pi / 2, 2.0)
    fill(memory, room.walls[0], 0.0, 1.5)
    fill(memory, room.walls[1], -1.5, 0.0)
    wall_corners.find_corners(memory.s)
    corner = room.corners[0]
    assert (corner.x, corner.y, corner.echoes) == pytest.approx((2.0, 2.0, 0.0))
    corner.echoes = 3.0
    for _ in range(3):
        enter_corners(room, reading(0.0, 0.0, math.pi / 4, 4.0), P)
        enter_corners(room, reading(0.0, 0.0, math.pi / 4, 1.0), P)
        enter_corners(room, reading(0.0, 0.0, 0.0, 4.0), P)
    wall_corners.find_corners(memory.s)
    assert (corner.is_used, corner.echoes, corner.passes, corner.ended) == (1, 3.0, 3.0, 3.0)
    room.walls[1].weight = 0.0
    wall_corners.find_corners(memory.s)
    assert corner.is_used == 0
