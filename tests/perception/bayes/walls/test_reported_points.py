"""Corners and edges at which sure walls end."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.state import Memory
from perception.bayes.memory.wall_records import WallMap
from perception.bayes.reports.object_report import corner_object
from perception.bayes.walls.bins import bin_of, enter_pass
from perception.bayes.walls.corners import add_information, find_corners
from perception.bayes.walls.report import room_report
from tests.perception.bayes.rooms import fill, new_room, place_wall, wall_ends


def two_walls(first: tuple[float, float], second: tuple[float, float]) -> tuple[Memory, WallMap]:
    """Return walls that cross at (2, 2), x = 2 and y = 2, each heard between two places along it."""
    memory, room = new_room()
    for wall, normal, ends in ((room.walls[0], 0.0, first), (room.walls[1], math.pi / 2, second)):
        place_wall(wall, np.zeros(2), normal, 2.0)
        fill(memory, wall, *ends)
    find_corners(memory.s)
    return memory, room


def test_spans_are_segments_and_reach_a_corner_that_is_heard() -> None:
    memory, room = new_room()
    place_wall(room.walls[2], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[2], -2.0, -1.0)
    fill(memory, room.walls[2], 0.0, 1.5)
    place_wall(room.walls[5], np.zeros(2), math.pi / 2, 2.0)
    fill(memory, room.walls[5], -1.5, 0.6)
    ends = wall_ends(memory)
    assert ends == pytest.approx(np.array([[2, -1.98, 2, -1.02], [2, 0, 2, 1.5], [1.5, 2, -0.6, 2]]), abs=0.05)
    find_corners(memory.s)
    room.corners[0].echoes = 4.0
    ends = wall_ends(memory)
    assert ends[1] == pytest.approx([2, 0, 2, 2], abs=0.05)
    assert ends[2] == pytest.approx([2, 2, -0.6, 2], abs=0.05)
    for b in range(bin_of(1.6), bin_of(1.9)):
        enter_pass(room.walls[2], b, 1.0)
    assert wall_ends(memory)[1] == pytest.approx([2, 0, 2, 1.5], abs=0.05)


def test_where_everything_echoes_no_wall_goes_on_to_a_far_inside_corner() -> None:
    """It does not answer there: the echoes are a post's, and a wall closed the doorway before it."""
    memory, room = two_walls((-2.0, 0.8), (-1.5, 1.0))
    room.corners[0].echoes = room.corners[0].ended = 9.0
    assert wall_ends(memory)[0] == pytest.approx([2, -2, 2, 2], abs=0.05)
    room.edge_echoes = 100.0
    assert wall_ends(memory)[0] == pytest.approx([2, -2, 2, 0.8], abs=0.05)


def test_the_mouth_of_a_dead_end_in_a_long_wall_has_two_edges() -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    for low, high in ((-3.0, -1.06), (1.06, 2.5)):  # one wall on both sides of the mouth
        fill(memory, room.walls[0], low, high)
    for k, side in ((1, 1.0), (2, -1.0)):
        place_wall(room.walls[k], np.array([3.5, 0.0]), side * math.pi / 2, 1.0)
        fill(memory, room.walls[k], *sorted((side * -1.4, side * 1.44)))
    find_corners(memory.s)
    for corner in room.corners:
        corner.echoes = 6.0 * corner.is_used
    points = [corner_object(point.item()) for point in room_report(memory)[1]]
    assert [seen.model for seen in points] == ["edge", "edge"]
    assert sorted(seen.y for seen in points) == pytest.approx([-1.0, 1.0], abs=0.01)
    assert [seen.x for seen in points] == pytest.approx([2.0, 2.0], abs=0.01)


def test_walls_that_end_near_each_other_meet_in_a_corner_that_no_range_passed() -> None:
    memory, room = two_walls((-1.0, 1.5), (-1.4, 1.0))
    assert wall_ends(memory)[0] == pytest.approx([2, -1, 2, 1.5], abs=0.05)
    room.corners[0].ended = 10.0
    assert wall_ends(memory) == pytest.approx(np.array([[2, -1, 2, 2], [2, 2, -1, 2]]), abs=0.05)
    room.corners[0].passes = 1.0
    _, (corner,) = room_report(memory)
    assert corner["log_odds"] > 0.0, "where everything echoes a corner answers no more than its walls do"
    room.corners[0].passes = 3.0
    assert wall_ends(memory)[0] == pytest.approx([2, -1, 2, 1.5], abs=0.05)


def test_a_corner_that_is_heard_proves_a_short_wall_and_is_reported() -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -1.0, 1.7)
    place_wall(room.walls[1], np.zeros(2), math.pi / 2, 2.0)
    fill(memory, room.walls[1], -1.8, -1.2, 0.8)
    find_corners(memory.s)
    assert len(wall_ends(memory)) == 1
    (corner,) = (it for it in room.corners if it.is_used == 1)
    corner.echoes, corner.passes, corner.ended = 9.0, 1.0, 9.0
    segments, points = room_report(memory)
    assert len(segments) == 2
    (point,) = points
    seen = corner_object(point.item())
    assert seen.model == "inside corner"
    assert (seen.x, seen.y) == pytest.approx((2.0, 2.0), abs=0.01)
    assert seen.support == 9
    assert seen.score > 0.99
    corner.passes = 5.0
    assert len(wall_ends(memory)) == 1


def test_a_wall_ends_at_the_edge_that_is_heard_and_the_edge_is_reported() -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -1.0, 1.0)
    find_corners(memory.s)
    assert len(room_report(memory)[1]) == 0
    (edge,) = (it for it in room.edges if it.is_used == 1 and it.second == 1)
    edge.echoes, edge.y = 6.0, 1.13
    edge.covariance_xx = edge.covariance_yy = 1e-5
    segments, points = room_report(memory)
    assert segments["y2"] == pytest.approx([1.13])
    assert [corner_object(point.item()).model for point in points] == ["edge"]
    edge.passes = 7.0
    assert len(room_report(memory)[1]) == 0


@pytest.mark.parametrize(("beyond_m", "reached_m"), [(0.9, 1.9), (1.2, 1.0)])
def test_a_wall_goes_on_to_the_corner_of_which_it_is_the_only_side_unless_a_doorway_fits_between(
    beyond_m: float, reached_m: float
) -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -1.0, 1.0)
    find_corners(memory.s)
    (corner,) = (it for it in room.edges if it.is_used == 1 and it.second == 1)
    corner.is_edge, corner.echoes, corner.y = 0, 6.0, 1.0 + beyond_m
    heard = corner.heard
    heard.xx = heard.yy = 1e5
    heard.x, heard.y = 1e5 * corner.x, 1e5 * corner.y
    assert room_report(memory)[0]["y2"] == pytest.approx([reached_m], abs=0.05)


def test_between_mirrors_a_corner_or_an_edge_that_is_heard_often_is_reported_whatever_is_known_of_its_walls() -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -1.0, 0.0)
    place_wall(room.walls[1], np.zeros(2), math.pi / 2, 2.0)
    fill(memory, room.walls[1], 0.0, 0.24)
    find_corners(memory.s)
    (corner,) = (it for it in room.corners if it.is_used == 1)
    room.edge_silences = 50.0
    assert len(room_report(memory)[1]) == 0
    corner.echoes = corner.far_echoes = 12.0
    assert [corner_object(point.item()).model for point in room_report(memory)[1]] == ["inside corner"]
    corner.passes = 7.0
    assert len(room_report(memory)[1]) == 0, "too many ranges went on"
    corner.passes, room.edge_echoes = 0.0, 100.0
    assert len(room_report(memory)[1]) == 0, "where everything answers, edges are heard from afar, too"
    corner.is_edge = 1
    assert [corner_object(point.item()).model for point in room_report(memory)[1]] == ["edge"]
    corner.passes = 3.0
    assert len(room_report(memory)[1]) == 0, "some of so few may be a wall's"
    room.edge_echoes, corner.echoes, corner.is_edge = 0.0, 0.0, 0
    corner.far_echoes = 0.0
    edge = room.edges[20]
    edge.is_used, edge.is_edge, edge.first, edge.echoes = 1, 1, 15, 9.0
    edge.covariance_xx = edge.covariance_yy = 1e-5
    assert [corner_object(point.item()).model for point in room_report(memory)[1]] == ["edge"]
    edge.far_echoes = 5.0
    assert len(room_report(memory)[1]) == 0, "from afar it is not heard"


def test_an_edge_that_was_heard_from_one_direction_is_not_sure() -> None:
    """Echoes of a wall that goes on come from there, too."""
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -1.0, 1.0)
    find_corners(memory.s)
    (edge,) = (it for it in room.edges if it.is_used == 1 and it.second == 1)
    edge.echoes = 30.0
    edge.covariance_xx = edge.covariance_yy = 1e-5
    for bearings, is_sure in (((0.0, 0.01), False), ((-0.4, 0.4), True)):
        edge.heard.xx = edge.heard.xy = edge.heard.yy = 0.0
        for bearing in 15 * bearings:
            add_information(edge.heard, math.cos(bearing), math.sin(bearing), 0.0, 1.0 / 0.02**2)
        (point,) = room_report(memory)[1]
        probability = corner_object(point.item()).probability
        assert probability is not None
        assert probability > 0.5
        assert (probability > 0.99) == is_sure
