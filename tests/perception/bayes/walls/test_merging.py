"""One wall is one line: parts are merged, and lines that others explain end."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.state import ESTABLISHED
from perception.bayes.memory.wall_records import IS_FREE, IS_KNOWN
from perception.bayes.walls import merging as wall_merging
from tests.perception.bayes.random_tracks import P
from tests.perception.bayes.rooms import SIGMA, fill, new_room, place_wall, refit, spans, wall_ends


@pytest.mark.parametrize(("turn", "shift", "is_one"), [(0.002, 0.005, True), (0.3, 0.0, False), (0.0, 0.2, False)])
def test_parts_of_one_line_become_one_wall(turn: float, shift: float, is_one: bool) -> None:
    memory, room = new_room()
    main, part = room.walls[0], room.walls[1]
    place_wall(main, np.zeros(2), 0.0, 2.0)
    fill(memory, main, -2.0, 0.0)
    place_wall(part, np.array([0.5, 0.9]), turn, 1.5 + shift)
    fill(memory, part, -0.6, 0.6)
    wall_merging.merge_walls(memory, P)
    assert (part.weight == 0.0) == is_one
    if is_one:
        assert main.weight == pytest.approx(33 * 5.0 + 20 * 5.0)
        assert spans(main)[[0, -1], [0, 1]] == pytest.approx([-1.98, 1.5], abs=0.1)
        assert main.offset == pytest.approx(2.0, abs=0.01)


def test_a_line_ends_when_a_heavier_wall_explains_its_echoes() -> None:
    memory, room = new_room()
    main, across = room.walls[0], room.walls[1]
    place_wall(main, np.zeros(2), 0.0, 2.0)
    fill(memory, main, -2.0, 2.0)
    place_wall(across, np.zeros(2), 0.08, 2.003)
    fill(memory, across, -0.3, 0.3)
    assert across.weight > 0.0
    wall_merging.drop_explained(memory.s, memory.tracks, P, 1)
    assert across.weight == 0.0
    wall_merging.drop_explained(memory.s, memory.tracks, P, 0)
    assert main.weight > 0.0


def test_a_line_behind_a_wall_and_one_on_a_drum_end() -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -2.0, 2.0)
    behind, on_drum, alone = room.walls[1], room.walls[2], room.walls[3]
    place_wall(behind, np.zeros(2), 0.0, 3.0)
    fill(memory, behind, -0.4, 0.4, 1.0, 2.5)
    place_wall(on_drum, np.zeros(2), math.pi, 2.0)
    fill(memory, on_drum, -0.3, 0.3, 1.0)
    place_wall(alone, np.zeros(2), math.pi / 2, 4.0)
    fill(memory, alone, -0.4, 0.4, 1.0)
    track = memory.tracks[0]
    track.status, track.x, track.y, track.radius = ESTABLISHED, -2.3, 0.0, 0.3
    track.root_xx, track.is_named = 0.05, 1
    wall_merging.merge_walls(memory, P)
    for k in (1, 2, 3):
        wall_merging.drop_explained(memory.s, memory.tracks, P, k)
    assert (behind.weight, on_drum.weight) == (0.0, 0.0)
    assert alone.weight > 0.0


def test_a_straight_wall_that_is_heard_from_afar_is_not_its_corners() -> None:
    for chi2, is_kept in ((50.0, False), (70.0, True)):
        memory, room = new_room()
        wall, corner = room.walls[0], room.corners[2]
        place_wall(wall, np.zeros(2), 0.0, 4.0)
        fill(memory, wall, -0.6, 0.6, 5.0, 4.0)
        corner.is_used, corner.x, corner.y = 1, 4.0, 0.66
        for k in range(wall.span_count):
            wall.spans[k].chi2 = chi2
        room.variance_m2 = 0.06**2
        wall_merging.drop_explained(memory.s, memory.tracks, P, 0)
        assert (wall.weight > 0.0) == is_kept


def test_a_line_that_does_not_fit_its_readings_ends_and_its_echoes_may_start_new_walls() -> None:
    memory, room = new_room()
    wall = room.walls[0]
    place_wall(wall, np.zeros(2), 0.0, 2.0)
    fill(memory, wall, -0.6, 0.6)
    room.recent_count = 2
    for k, range_m in enumerate((1.5, 0.8)):
        q = room.recent[k].reading
        q.x, q.y, q.axis_x, q.axis_y, q.range_m = 0.5, 0.1, 1.0, 0.0, range_m
        room.recent[k].is_free = IS_KNOWN
    wall_merging.drop_explained(memory.s, memory.tracks, P, 0)
    assert wall.weight > 0.0
    wall.misfit = 4.0
    wall_merging.drop_explained(memory.s, memory.tracks, P, 0)
    assert wall.weight == 0.0
    assert [room.recent[k].is_free for k in range(2)] == [IS_FREE, IS_KNOWN]


def test_the_frame_of_a_wall_that_outgrows_it_moves_along_it() -> None:
    memory, room = new_room()
    wall = room.walls[0]
    place_wall(wall, np.array([1.0, -0.5]), 0.4, 2.0)
    fill(memory, wall, -1.2, 5.4)
    before = wall_ends(memory)
    wall_merging.merge_walls(memory, P)
    assert wall.spans[0].first_bin > 38
    refit(memory, wall)
    assert wall_ends(memory) == pytest.approx(before, abs=1e-6)


def test_the_frame_of_a_wall_that_turned_away_from_it_turns_onto_the_line() -> None:
    memory, room = new_room()
    wall = room.walls[0]
    place_wall(wall, np.array([1.0, -0.5]), 0.4, 2.0)
    for b in range(80, 130):
        of, u = wall.bins[b], (b - 95.5) * 0.06
        of.weight, of.precision = 5.0, 5.0 / SIGMA**2
        of.offset_sum, of.range_sum = of.precision * (2.0 - 0.2 * u), of.precision
    refit(memory, wall)
    before = wall_ends(memory)
    assert wall.slope == pytest.approx(-0.2, abs=1e-3)
    for _ in range(2):
        wall_merging.merge_walls(memory, P)
    assert wall.slope == pytest.approx(0.0, abs=1e-3)
    assert math.hypot(wall.normal_x, wall.normal_y) == pytest.approx(1.0)
    assert wall_ends(memory) == pytest.approx(before, abs=0.07)
    assert wall.weight == pytest.approx(50 * 5.0, rel=0.1)
