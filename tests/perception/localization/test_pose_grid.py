"""The table of a room against the exact expected ranges, and the search in it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.emulator.scene import compile_scene
from drivers.messages import Pose, wrap_angle
from perception.localization.expected_ranges import Beams, Reflection, expected_ranges
from perception.localization.pose_grid import CELL_M, STARTS_MAX, STEP_RAD, PoseGrid
from perception.localization.range_likelihood import RangeModel
from runtime.simulation.furnished_rooms import furnished_room
from runtime.simulation.localization_trials import room_of
from runtime.simulation.random_rooms import ACOUSTICS
from tests.perception.localization.rooms import CROOKED, HALF_ANGLE, RING, panorama_of, stand, world_of


@pytest.mark.parametrize("reflection", ["cone", "specular"])
def test_the_table_holds_the_expected_ranges(reflection: Reflection) -> None:
    seed = next(seed for seed in range(10) if furnished_room(seed).world.drum)
    room = room_of(compile_scene(furnished_room(seed).world))
    grid = PoseGrid(room, HALF_ANGLE, RING.window_m, 0.2)
    x, y = np.array([(i, j) for i in range(0, grid.shape[0], 3) for j in range(0, grid.shape[1], 3)]).T
    direction = np.arange(len(x)) % 60
    table = grid.expected(reflection)[direction, x, y]
    place_x, place_y = grid.places(x, y).T
    beams = Beams(place_x, place_y, direction.astype(np.float64) * STEP_RAD)
    exact = expected_ranges(room, beams, HALF_ANGLE, reflection).range_m
    silent = exact > RING.window_m
    assert (np.isinf(table) == silent).mean() > 0.99  # at the beam's very edge, rounding decides
    both = ~silent & np.isfinite(table)
    assert (np.abs(table[both] - exact[both]) < 0.02).mean() > 0.99


def test_a_search_offers_the_pose() -> None:
    truth = Pose(1.5, 2.2, 0.5)
    room, firing = stand(world_of(CROOKED, ACOUSTICS), truth)
    grid = PoseGrid(room, HALF_ANGLE, RING.window_m, 0.3)
    search = grid.search(panorama_of(firing), RangeModel.of_ring(RING), 0.5)
    quanta = 0
    while True:
        try:
            next(search)
        except StopIteration as stop:
            starts = stop.value
            break
        quanta += 1
    assert quanta > 60
    assert len(starts) <= STARTS_MAX
    near = np.hypot(starts[:, 0] - truth.x, starts[:, 1] - truth.y) < 1.5 * CELL_M
    turned = np.array([abs(wrap_angle(theta - truth.theta)) for theta in starts[:, 2].tolist()])
    assert np.flatnonzero(near & (turned < math.radians(7.0)))[0] < 5
