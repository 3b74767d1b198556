"""Follow-valley: straight where nothing stands, beside what does, and a stand where no direction is free."""

from __future__ import annotations

import math

import numpy as np
import pytest

from behaviors.follow_valley import Valley, follow_valley
from behaviors.response import Response
from behaviors.valley.look_ahead import Search
from behaviors.valley.polar_histogram import SECTORS
from config.behaviors import FollowValleyConfig
from perception.percept import Percept, Pose
from tests.behaviors.valley.windows import Wall, at
from tests.behaviors.views import EVERYWHERE

CONFIG = FollowValleyConfig()
RADIUS_M = 0.381
TO_GOAL = Response("move_to_goal", 0.5, 0.0)


def response(
    percept: Percept, before: Valley | None = None, search: Search | None = None, **changes: float
) -> tuple[Response, Valley]:
    config = CONFIG.model_copy(update=changes)
    return follow_valley(percept, TO_GOAL, 5.0, before or Valley(), search or Search(), RADIUS_M, config)


def test_a_free_way_is_driven_straight_with_the_length_of_move_to_goal() -> None:
    found, valley = response(at(0.0, 0.0))
    assert (found.schema, found.x, found.y) == ("follow_valley", 0.5, 0.0)
    assert valley == Valley("0" * SECTORS, 0.0)
    found, _ = response(at(0.0, 0.0), follow_valley_gain=2.0)
    assert found.x == 1.0


def test_it_passes_a_wall_on_the_shorter_side_and_keeps_to_that_side() -> None:
    wall: Wall = (1.0, -1.5, 1.0, 0.6)
    found, valley = response(at(0.0, 0.0, walls=[wall]))
    assert math.radians(40.0) < math.atan2(found.y, found.x) < math.radians(120.0)
    centred: Wall = (1.0, -1.0, 1.0, 1.0)
    left, _ = response(at(0.0, 0.0, walls=[centred]), Valley(valley.blocked, 1.2))
    right, _ = response(at(0.0, 0.0, walls=[centred]), Valley(valley.blocked, -1.2))
    assert left.y > 0.0 > right.y


def test_it_drives_between_two_walls_and_not_through_a_gap_that_is_too_narrow() -> None:
    half = RADIUS_M + CONFIG.safety_m
    for gap, passes in ((half + 0.15, True), (half - 0.2, False)):
        walls: list[Wall] = [(0.9, gap, 0.9, gap + 2.0), (0.9, -gap, 0.9, -gap - 2.0)]
        found, _ = response(at(0.0, 0.0, walls=walls))
        assert (abs(math.atan2(found.y, found.x)) < 0.2) is passes


def test_a_correction_of_the_heading_by_less_than_a_degree_is_not_made() -> None:
    found, _ = response(at(0.0, 0.0, math.radians(0.8)))
    assert math.atan2(found.y, found.x) == pytest.approx(math.radians(0.8))
    found, _ = response(at(0.0, 0.0, math.radians(-1.5)))
    assert math.atan2(found.y, found.x) == pytest.approx(math.radians(-0.75))
    found, _ = response(at(0.0, 0.0, math.radians(-3.0)))
    assert found.y == pytest.approx(0.0)


def test_the_direction_turns_little_by_little_where_it_is_free() -> None:
    _, valley = response(at(0.0, 0.0), Valley(direction_rad=1.0))
    assert valley.direction_rad == pytest.approx(0.93)
    _, valley = response(at(0.0, 0.0, echoes=[(0.5, 0.7)]), Valley(direction_rad=1.0))
    assert valley.direction_rad is not None
    assert math.cos(valley.direction_rad) > 0.98, "at once where something stands in between"


def test_fresh_echoes_count_without_a_grid() -> None:
    echoes = np.array([[0.9, 0.0]])
    found, _ = response(Percept(Pose(0.0, 0.0, 0.0), echoes, EVERYWHERE))
    assert abs(math.atan2(found.y, found.x)) > math.radians(30.0)


def test_hemmed_in_it_stands() -> None:
    ring = [(0.45 * math.cos(a), 0.45 * math.sin(a)) for a in np.linspace(0.0, math.tau, 36)]
    found, valley = response(at(0.0, 0.0, echoes=ring))
    assert (found.x, found.y) == (0.0, 0.0)
    assert valley.direction_rad is None
    assert valley.blocked == "1" * SECTORS


def test_the_target_lies_on_the_way_of_the_look_ahead() -> None:
    found, _ = response(at(0.0, 0.0), search=Search(way=((0.0, 0.0), (0.0, 3.0))))
    assert math.atan2(found.y, found.x) == pytest.approx(math.pi / 2.0)


def test_a_base_with_a_turning_circle_does_not_turn_where_something_stands_in_it() -> None:
    percept = at(0.0, 0.0, math.pi / 2.0, echoes=[(0.6, 0.6)])
    free, _ = response(percept)
    bound, _ = response(percept, turning_radius_m=1.0)
    assert free.y == 0.0, "on the spot, and past it on the right"
    assert math.atan2(bound.y, bound.x) > math.radians(60.0)


def test_what_is_not_finite_reaches_the_arbiter() -> None:
    broken = follow_valley(
        at(0.0, 0.0), Response("move_to_goal", math.nan, 0.0), 1.0, Valley(), Search(), 0.4, CONFIG
    )
    assert math.isnan(broken[0].x)


def test_close_to_the_goal_no_look_ahead_leads_away_from_it() -> None:
    """Beside a wall one finds that the goal can be reached, the next that it cannot: the robot turned to and fro."""
    back = Search(goal=(0.3, 0.0), way=((0.0, 0.0), (-1.0, 0.0)), reaches=False)
    for goal_m, along in ((0.3, 0.5), (2.0, -0.5)):
        found, _ = follow_valley(at(0.0, 0.0), TO_GOAL, goal_m, Valley(), back, RADIUS_M, CONFIG)
        assert found.x == pytest.approx(along)


def test_near_the_goal_what_is_heard_counts_and_not_what_the_grid_shows_there() -> None:
    arc: list[Wall] = [(1.1, 0.2, 1.2, -0.1)]
    for goal_m, echoes, goes_straight in ((1.2, [], True), (1.2, [(1.1, 0.1)], False), (1.6, [], False)):
        found, _ = follow_valley(
            at(0.0, 0.0, walls=arc, echoes=echoes), TO_GOAL, goal_m, Valley(), Search(), RADIUS_M,
            CONFIG.model_copy(update={"block_m": 1.0, "free_m": 1.0}),
        )  # fmt: skip
        assert (found.y == pytest.approx(0.0)) is goes_straight
