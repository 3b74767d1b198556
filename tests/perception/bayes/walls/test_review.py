"""A wall is reviewed by the readings that are remembered."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pytest

from perception.bayes.memory.state import Memory
from perception.bayes.memory.wall_records import REMEMBERED_MAX, WALL_BINS, WallMap
from perception.bayes.walls.corners import find_corners
from perception.bayes.walls.report import room_report
from perception.bayes.walls.review import (
    PLACE_NAT,
    RECENT_SPACING_M,
    SWITCH_NAT,
    UNHEARD_NAT,
    find_covered,
    is_of_another,
    next_wall,
    remember,
    review,
)
from tests import naive_walls
from tests.perception.bayes.random_tracks import P, S
from tests.perception.bayes.rooms import fill, new_room, place_wall, reading, wall_ends

SLANT = 0.9
"""Angle between the axis and the wall's normal, rad: the wall answers from the beam's edge."""


def rough_wall() -> tuple[Memory, WallMap]:
    """Return a wall at x = 2 that is known from y = −2 to 0, where slanting walls answer."""
    memory, room = new_room()
    room.edge_echoes = 100.0
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -2.0, 0.0)
    return memory, room


def look(room: WallMap, along: Iterable[float], further: float = 0.0) -> None:
    """Remember slanting looks that touch the wall at these places, longer by so much."""
    for k, y in enumerate(along):
        turn = SLANT - S.half_angle_rad
        range_m = 1.0 / math.cos(turn)
        x0, y0 = 2.0 - range_m * math.cos(turn), y - range_m * math.sin(turn)
        room.remembered_of[k % 8] = 0.0
        remember(room, k % 8, reading(x0, y0, SLANT, range_m + further))


def test_a_wall_goes_on_where_echoes_lie_on_its_line_that_nothing_else_explains() -> None:
    memory, room = rough_wall()
    look(room, np.arange(0.1, 1.5, 0.2))
    assert wall_ends(memory)[0] == pytest.approx([2, -1.98, 2, 0], abs=0.04)
    review(memory.s, memory.tracks, P, 0)
    assert wall_ends(memory)[0] == pytest.approx([2, -1.98, 2, 1.3], abs=0.08)
    assert room.walls[0].spans[0].high < 0.1, "only what is reported"


def test_a_doorway_stays_open_and_a_lone_echo_is_no_wall() -> None:
    memory, room = rough_wall()
    look(room, np.arange(0.1, 0.9, 0.05), 1.0)
    look(room, [0.5, 1.3])
    review(memory.s, memory.tracks, P, 0)
    assert wall_ends(memory) == pytest.approx(np.array([[2, -1.98, 2, 0]]), abs=0.08)


def test_what_was_thought_to_be_wall_is_open_where_ranges_went_on() -> None:
    memory, room = rough_wall()
    for b in range(room.walls[0].spans[0].end_bin - 5, room.walls[0].spans[0].end_bin):
        room.walls[0].bins[b].weight = 1.0
    look(room, np.arange(-1.9, -0.3, 0.05))
    look(room, np.arange(-0.28, 0.0, 0.02), 1.0)
    review(memory.s, memory.tracks, P, 0)
    assert wall_ends(memory)[0] == pytest.approx([2, -1.98, 2, -0.3], abs=0.08)


def test_ranges_that_went_on_count_where_a_wall_was_sure_before() -> None:
    memory, room = rough_wall()
    for b in range(WALL_BINS):
        room.walls[0].bins[b].weight *= 2.0
    look(room, np.arange(-1.9, -0.3, 0.05))
    look(room, np.arange(-0.28, 0.0, 0.02), 1.0)
    review(memory.s, memory.tracks, P, 0)
    assert wall_ends(memory)[0] == pytest.approx([2, -1.98, 2, -0.3], abs=0.08)


def test_the_echoes_of_another_wall_show_nothing() -> None:
    memory, room = rough_wall()
    place_wall(room.walls[1], np.zeros(2), 0.2, 2.0)
    fill(memory, room.walls[1], -1.0, 1.0)
    q = reading(0.0, 0.0, 0.2, 2.0)
    assert is_of_another(room, memory.tracks, q, P, 0, 0.5)
    room.walls[1].weight = 0.0
    assert not is_of_another(room, memory.tracks, q, P, 0, 0.5)


def test_the_line_is_fitted_again_to_the_remembered_echoes() -> None:
    memory, room = rough_wall()
    for b in range(WALL_BINS):
        room.walls[0].bins[b].precision *= 0.01
        room.walls[0].bins[b].offset_sum = room.walls[0].bins[b].precision * (2.0 + 0.01 * (b - 80) * 0.06)
    look(room, np.arange(-1.9, 0.0, 0.05))
    review(memory.s, memory.tracks, P, 0)
    of = room.walls[0].reviewed
    assert (of.offset, of.slope) == pytest.approx((2.0, 0.0), abs=2e-3)
    room.walls[0].variance_slope *= 1e4
    room.walls[0].slope = 0.01
    segment = room_report(memory)[0][0]
    assert segment["x1"] == pytest.approx(2.0, abs=2e-3)
    assert segment["variance_turn"] == pytest.approx(of.variance_slope)


def test_mirrors_are_not_reviewed() -> None:
    memory, room = rough_wall()
    room.edge_echoes = 0.0
    look(room, np.arange(0.1, 1.5, 0.2))
    review(memory.s, memory.tracks, P, 0)
    assert room.walls[0].reviewed.information == 0.0
    assert wall_ends(memory)[0] == pytest.approx([2, -1.98, 2, 0], abs=0.04)


def test_walls_of_which_enough_is_known_are_reviewed_in_turn() -> None:
    memory, room = new_room()
    assert next_wall(room, 3) == -1
    for k in (2, 5, 9):
        place_wall(room.walls[k], np.zeros(2), float(k), 2.0)
        fill(memory, room.walls[k], -1.0, 1.0)
    room.walls[9].chi2 = 13.0
    assert [next_wall(room, turn) for turn in range(4)] == [2, 5, 2, 5]


def test_covered_places_are_the_likeliest_sequence() -> None:
    memory, room = new_room()
    rng = np.random.default_rng(3)
    for _ in range(40):
        evidence = rng.normal(0.0, 4.0, WALL_BINS) * (rng.random(WALL_BINS) < 0.4)
        evidence += 3.0 * np.repeat(rng.integers(-1, 2, WALL_BINS // 8), 8) * (evidence != 0.0)
        for b, value in enumerate(evidence.tolist()):
            memory.s[0].scratch.wall_evidence[b] = value
        find_covered(memory.s, 0)
        places = naive_walls.likeliest_cover(evidence, SWITCH_NAT, UNHEARD_NAT, PLACE_NAT)
        marked = [room.walls[0].bins[b].is_held == 1 for b in range(WALL_BINS)]
        assert marked == [is_on and value > 0.0 for is_on, value in zip(places, evidence.tolist(), strict=True)]
        assert [room.walls[0].bins[b].is_open == 0 for b in range(WALL_BINS)] == [bool(is_on) for is_on in places]


def test_spaced_readings_are_remembered_and_the_oldest_forgotten() -> None:
    memory, room = new_room()
    for k in range(5):
        remember(room, 1, reading(0.5 * RECENT_SPACING_M * k, 0.0, 0.0, 1.0))
        remember(room, 2, reading(0.0, 0.0, 0.0, 1.0))
    assert room.remembered_count == 3, "two of sensor 1, and one of sensor 2"
    room.remembered_count = REMEMBERED_MAX
    remember(room, 3, reading(7.0, 0.0, 0.0, 1.0))
    assert room.remembered_count == REMEMBERED_MAX, "it is not known what slanting walls do"
    room.edge_echoes = 100.0
    remember(room, 3, reading(7.0, 0.0, 0.0, 1.0))
    assert room.remembered_count == REMEMBERED_MAX, "no wall is known that they could show"
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -1.5, 1.9)
    remember(room, 3, reading(7.0, 0.0, 0.0, 1.0))
    assert room.remembered[0].x == 7.0
    room.edge_echoes, room.edge_silences = 0.0, 100.0
    remember(room, 4, reading(8.0, 0.0, 0.0, 1.0))
    assert room.remembered[1].x == 8.0, "between mirrors they show corners and edges"


def test_a_wall_of_which_a_review_leaves_nothing_is_none() -> None:
    memory, room = rough_wall()
    place_wall(room.walls[1], np.zeros(2), math.pi / 2, 2.0)
    fill(memory, room.walls[1], -1.5, 1.9)
    find_corners(memory.s)
    room.corners[0].echoes = 9.0
    look(room, np.arange(-1.9, 0.0, 0.05))
    review(memory.s, memory.tracks, P, 0)
    assert len(wall_ends(memory)) == 2
    for b in range(WALL_BINS):
        room.walls[0].bins[b].is_held = 0
    assert len(wall_ends(memory)) == 1
