"""The shortest way of a round robot: round obstacles, through openings that are wide enough, or none."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from bench.trials.shortest_way import CELL_M, free_space, length_m, shortest_way
from config.world import DrumConfig, PolygonConfig, WallConfig, WorldConfig
from drivers.emulator.acoustics import clearance
from drivers.emulator.scene import compile_scene

ROOM = PolygonConfig(vertices_m=((0.0, 0.0), (8.0, 0.0), (8.0, 6.0), (0.0, 6.0)))


def divided(opening_m: float) -> WorldConfig:
    return WorldConfig(polygon=(ROOM,), wall=(WallConfig(x1_m=4.0, y1_m=0.0, x2_m=4.0, y2_m=6.0 - opening_m),))


def test_free_cells_are_those_with_room() -> None:
    world = WorldConfig(polygon=(ROOM,), drum=(DrumConfig(x_m=3.0, y_m=2.0, radius_m=0.3),))
    space, scene = free_space(world, 0.6), compile_scene(world)
    for row in range(0, space.free.shape[0], 3):
        for column in range(0, space.free.shape[1], 3):
            x, y = space.place((row, column))
            room_m = clearance(x, y, scene.circles, scene.segments)
            if abs(room_m - 0.6) > 1e-6:
                assert space.free[row, column] == (room_m > 0.6)


def test_a_free_way_is_straight_and_one_round_a_wall_as_long_as_it_must_be() -> None:
    space = free_space(divided(2.0), 0.5)
    straight = shortest_way(space, (1.0, 1.0), (3.0, 3.0))
    assert straight is not None
    assert length_m(straight) == pytest.approx(math.hypot(2.0, 2.0), abs=1.5 * CELL_M)
    around = shortest_way(space, (1.0, 1.0), (7.0, 1.0))
    assert around is not None
    assert all(math.dist(a, b) < 3.0 * CELL_M for a, b in pairwise(around))
    tight_m = 2.0 * (math.hypot(3.0, 3.0) + 0.4)
    assert tight_m < length_m(around) < 1.1 * tight_m


def test_an_opening_that_is_too_narrow_is_none() -> None:
    assert shortest_way(free_space(divided(0.9), 0.5), (1.0, 1.0), (7.0, 1.0)) is None
    assert shortest_way(free_space(divided(2.0), 0.5), (1.0, 1.0), (4.2, 1.0)) is None, "no room at the goal"
