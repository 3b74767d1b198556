"""The table of a room against the exact expected ranges, and the search in it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.trials.furnished_rooms import furnished_room
from bench.trials.random_rooms import ACOUSTICS
from drivers.messages import Pose, wrap_angle
from perception.kernel import Floats
from perception.localization.known_room.mixed_reflection import ROOMS, LearnedShares
from perception.localization.known_room.pose_grid import (
    GRID_CELL_M,
    GRID_STEP_RAD,
    RANGE_STEPS,
    SILENT_CODE,
    PoseGrid,
)
from perception.localization.known_room.surroundings import FRINGE_RAD, make_surroundings
from perception.localization.room.expected_ranges import Beams, Reflection, expected_ranges
from perception.localization.room.range_likelihood import RangeModel
from perception.localization.room.room import Room, room_of
from perception.snapshot import put_back, snapshot_of
from tests.perception.localization.rooms import CROOKED, HALF_ANGLE, RING, panorama_of, stand, world_of

pytestmark = pytest.mark.compiled
TRUTH = Pose(1.5, 2.2, 0.5)


def grid_of(room: Room) -> PoseGrid:
    """The grid of a room."""
    return PoseGrid(room, make_surroundings(room, RangeModel.of_ring(RING), HALF_ANGLE), 0.2)


def crooked(reflection: Reflection = "cone") -> tuple[PoseGrid, Floats]:
    """The grid of a small room, and the readings of a stand in it."""
    room, firing = stand(world_of(CROOKED, ACOUSTICS.model_copy(update={"model": reflection})), TRUTH)
    found = panorama_of(firing)
    return grid_of(room), np.column_stack([found.x, found.y, np.cos(found.axis), np.sin(found.axis), found.range_m])


@pytest.mark.parametrize("reflection", ["cone", "specular"])
def test_the_table_holds_the_expected_ranges(reflection: Reflection) -> None:
    seed = next(seed for seed in range(10) if furnished_room(seed).world.drum)
    room = room_of(furnished_room(seed).world)
    grid = grid_of(room)
    x, y = np.array([(i, j) for i in range(0, grid.shape[0], 3) for j in range(0, grid.shape[1], 3)]).T
    direction = np.arange(len(x)) % 60
    grid._due = grid.shape[0] * grid.shape[1]
    grid._fill()
    codes = grid._table[("cone", "specular").index(reflection)][direction, x, y]
    table = np.where(codes == SILENT_CODE, np.inf, codes * (RING.window_m / RANGE_STEPS))
    place_x, place_y = (grid._origin + GRID_CELL_M * np.column_stack([x, y])).T
    beams = Beams(place_x, place_y, direction.astype(np.float64) * GRID_STEP_RAD)
    half = HALF_ANGLE + (FRINGE_RAD if reflection == "specular" else 0.0)
    exact = expected_ranges(room, beams, half, reflection).range_m
    silent = exact > RING.window_m
    assert (np.isinf(table) == silent).all()
    assert table[~silent] == pytest.approx(exact[~silent], abs=0.02)


def test_a_search_offers_the_pose_and_another_one_needs_no_table() -> None:
    grid, readings = crooked()
    quanta = []
    for _ in range(2):
        grid.begin(readings, LearnedShares().profiles())
        quanta.append(0)
        while grid.is_searching:
            grid.refine()
            quanta[-1] += 1
    assert quanta[0] > quanta[1] > 60
    starts = grid.best_starts(100)
    assert len(starts) <= 100
    near = np.hypot(starts[:, 0] - TRUTH.x, starts[:, 1] - TRUTH.y) < 1.5 * GRID_CELL_M
    turned = np.array([abs(wrap_angle(theta - TRUTH.theta)) for theta in starts[:, 2].tolist()])
    assert np.flatnonzero(near & (turned < math.radians(7.0)))[0] < 5


@pytest.mark.parametrize("quanta", [10, 200])
def test_a_search_goes_on_from_a_snapshot_with_the_same_result(quanta: int) -> None:
    grid, readings = crooked()
    grid.begin(readings, LearnedShares().profiles())
    for _ in range(quanta):
        grid.refine()
    other = crooked()[0]
    put_back(other, snapshot_of(grid))
    for one in (grid, other):
        one.drop_caches()
        while one.is_searching:
            one.refine()
    assert np.array_equal(grid.best_starts(50), other.best_starts(50))


@pytest.mark.parametrize(("reflection", "profile"), [("cone", 0), ("specular", 1)])
def test_a_search_tries_rough_and_smooth_surfaces_and_says_which_fit(reflection: Reflection, profile: int) -> None:
    grid, readings = crooked(reflection)
    best = []
    for profiles in (LearnedShares().profiles(), np.array([ROOMS[profile][:3]])):
        grid.begin(readings, profiles)
        while grid.is_searching:
            grid.refine()
        best.append((grid.best_profile, grid.best_starts(100)[0].tolist()))
    assert best == [(profile, best[0][1]), (0, best[0][1])]


def test_a_cancelled_search_is_over() -> None:
    grid, readings = crooked()
    grid.begin(readings, LearnedShares().profiles())
    grid.cancel()
    assert not grid.is_searching
