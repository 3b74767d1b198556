"""The look-ahead: out of dead ends that VFH+ alone drives into, by ways that the robot can drive."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from behaviors.valley.look_ahead import Place, Search, begin, carrot, expand
from config.behaviors import FollowValleyConfig
from perception.percept import Percept
from tests.behaviors.valley.windows import Wall, at

CONFIG = FollowValleyConfig()
RADIUS_M = 0.381
DEAD_END: tuple[Wall, ...] = ((2.0, -1.5, 2.0, 1.5), (-1.0, 1.5, 2.0, 1.5), (-1.0, -1.5, 2.0, -1.5))
NARROW: tuple[Wall, ...] = ((2.0, -1.0, 2.0, 1.0), (-1.0, 1.0, 2.0, 1.0), (-1.0, -1.0, 2.0, -1.0))
CELL: tuple[Wall, ...] = (
    (1.5, -1.5, 1.5, 1.5),
    (-1.5, 1.5, 1.5, 1.5),
    (-1.5, -1.5, 1.5, -1.5),
    (-1.5, -1.5, -1.5, 1.5),
)


def searched(
    percept: Percept, goal: Place, config: FollowValleyConfig = CONFIG, way: tuple[Place, ...] = ()
) -> tuple[Search, int]:
    search, quanta = begin(Search(way=way), percept, goal), 0
    while not search.is_done:
        search = expand(search, percept, RADIUS_M, config)
        quanta += 1
        assert quanta < 2000
    return search, quanta


def clearance_m(search: Search, walls: tuple[Wall, ...]) -> float:
    """Return the least distance between the way and a wall, both sampled."""
    way = [
        (ax + k / 20 * (bx - ax), ay + k / 20 * (by - ay))
        for (ax, ay), (bx, by) in pairwise(search.way) for k in range(21)
    ]  # fmt: skip
    surfaces = [(x1 + k / 60 * (x2 - x1), y1 + k / 60 * (y2 - y1)) for x1, y1, x2, y2 in walls for k in range(61)]
    return min(math.dist(a, b) for a in way for b in surfaces)


def test_nothing_in_the_way_is_a_straight_way() -> None:
    search, quanta = searched(at(0.0, 0.0), (3.2, 1.0))
    assert search.way[0] == (0.0, 0.0)
    assert search.way[-1] == (3.2, 1.0)
    assert sum(math.dist(a, b) for a, b in pairwise(search.way)) == pytest.approx(math.hypot(3.2, 1.0))
    assert quanta == len(search.way)
    assert search.reaches


def test_it_leads_out_of_a_dead_end_and_round_it() -> None:
    search, quanta = searched(at(1.0, 0.0, walls=DEAD_END), (4.0, 0.0))
    assert search.reaches
    assert search.way[-1] == (4.0, 0.0)
    assert min(x for x, _ in search.way) < -1.0
    assert clearance_m(search, DEAD_END) > RADIUS_M + CONFIG.safety_m - 0.08  # cells are 0.1 m across
    length_m = sum(math.dist(a, b) for a, b in pairwise(search.way))
    around_m = 2.0 + 0.6 + 3.0 + 1.6 + 2.0 + 2.5
    assert length_m < 1.15 * around_m
    assert quanta < 400


def test_a_way_that_has_failed_is_not_tried_for_ever_although_what_closed_it_is_forgotten() -> None:
    """The grid forgets the back of a dead end each time the robot looks away: a way out is kept in the end."""
    search, goal, turns_back = Search(), (4.0, 0.0), []
    for walls in (NARROW[1:], NARROW, NARROW) * 5:
        percept = at(0.0, 0.0, walls=walls)
        search = begin(search, percept, goal)
        while not search.is_done:
            search = expand(search, percept, RADIUS_M, CONFIG)
        turns_back.append(min(x for x, _ in search.way) < -1.0)
    assert turns_back[:3] == [False, False, True]
    assert all(turns_back[-4:]), turns_back
    assert all(math.dist(place, (0.0, 0.0)) < 2.5 for place in search.failed)


def test_a_way_that_turns_back_is_taken_once_it_is_found_twice() -> None:
    """An echo or two close a gap ahead now and then, and the robot turned back for a second each time."""
    goal, open_ = (4.0, 0.0), at(0.0, 0.0, walls=NARROW[1:])
    before, _ = searched(open_, goal)
    closed = at(0.0, 0.0, walls=NARROW)

    def again(search: Search, percept: Percept) -> Search:
        search = begin(search, percept, goal)
        while not search.is_done:
            search = expand(search, percept, RADIUS_M, CONFIG)
        return search

    once = again(before, closed)
    assert (once.way, once.reaches) == (before.way, True)
    assert min(x for x, _ in again(once, closed).way) < -1.0
    assert again(again(once, open_), closed).way[-1] == goal, "the doubt is over once the way ahead is found again"
    assert min(x for x, _ in again(again(once, open_), closed).way) >= 0.0


def test_a_goal_that_is_walled_in_has_no_way_and_the_nearest_place_is_found() -> None:
    search, _ = searched(at(-4.0, 0.0, walls=CELL), (0.0, 0.0))
    assert not search.reaches
    assert math.hypot(*search.way[-1]) == pytest.approx(1.5 + RADIUS_M + CONFIG.safety_m, abs=0.4)


def test_a_goal_with_something_beside_it_is_reached_and_none_behind_a_wall() -> None:
    beside: Wall = (-0.3, 0.3, 0.3, 0.3)
    search, _ = searched(at(-2.0, 0.0, walls=[beside]), (0.0, 0.0))
    assert (search.reaches, search.way[-1]) == (True, (0.0, 0.0))
    before: Wall = (-0.3, -6.3, -0.3, 6.3)
    search, _ = searched(at(-2.0, 0.0, walls=[before]), (0.0, 0.0))
    assert search.way[-1] != (0.0, 0.0)
    assert all(x < -0.3 for x, _ in search.way)


def test_a_gap_away_from_the_goal_is_passed_if_the_way_in_force_leads_through_it() -> None:
    walls = [*CELL[:3], (-1.5, -1.5, -1.5, -0.5), (-1.5, 0.5, -1.5, 1.5)]
    percept, goal = at(-0.9, 0.0, walls=walls), (4.0, 0.0)
    assert not searched(percept, goal)[0].reaches
    way = tuple((-0.9 - 0.5 * k, 0.0) for k in range(5))
    assert searched(percept, goal, way=way)[0].reaches


def test_a_robot_that_is_walled_in_stays() -> None:
    search, _ = searched(at(0.0, 0.0, walls=CELL), (4.0, 0.0))
    assert not search.reaches
    assert all(max(abs(x), abs(y)) < 1.5 - RADIUS_M + 0.08 for x, y in search.way)


def test_a_goal_beyond_the_grid_is_approached_through_what_is_unknown() -> None:
    search, _ = searched(at(0.0, 0.0), (40.0, 0.0))
    assert search.reaches
    assert 6.4 <= search.way[-1][0] < 7.0
    blind = Percept(at(0.0, 0.0).pose, at(0.0, 0.0).obstacles, at(0.0, 0.0).field_of_view)
    search, _ = searched(blind, (40.0, 0.0))
    assert 1.0 < search.way[-1][0] < 2.0


def test_the_way_found_before_stays_until_another_is_found_and_the_search_repeats_to_the_bit() -> None:
    percept = at(1.0, 0.0, walls=DEAD_END)
    first, quanta = searched(percept, (4.0, 0.0))
    again = begin(first, percept, (4.0, 0.5))
    for _ in range(quanta // 2):
        assert again.way == first.way
        again = expand(again, percept, RADIUS_M, CONFIG)
    assert searched(percept, (4.0, 0.0))[0] == first


def test_the_number_of_places_is_bounded() -> None:
    config = CONFIG.model_copy(update={"look_ahead_nodes_max": 40})
    search, quanta = searched(at(1.0, 0.0, walls=DEAD_END), (4.0, 0.0), config)
    assert quanta <= 40
    assert not search.reaches
    assert search.way


def test_the_target_is_so_far_ahead_on_the_way() -> None:
    search = Search(way=((0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (1.0, 1.0)))
    assert carrot(search, 0.2, 0.1, 0.5) == pytest.approx((0.7, 0.0))
    assert carrot(search, 0.2, 0.1, 1.2) == pytest.approx((1.0, 0.4))
    assert carrot(search, 0.2, 0.1, 9.0) == pytest.approx((1.0, 1.0))
    assert carrot(search, 1.0, 3.0, 0.5) is None, "too far from the way"
    assert carrot(Search(), 0.0, 0.0, 1.0) is None
    assert carrot(Search(way=((0.0, 0.0),)), 0.0, 0.0, 1.0) is None
