"""Corners and edges that are heard on the line of a known wall."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.polygon_parameters import EDGE_REACH_M
from perception.bayes.memory.state import Memory
from perception.bayes.memory.wall_records import WallMap
from perception.bayes.reports.object_report import corner_object
from perception.bayes.walls.contact import HEARD_REACH_M
from perception.bayes.walls.corners import EDGE_ECHOES_MIN, EDGE_SAME_M, KEPT, find_corners
from perception.bayes.walls.points import (
    ACROSS_M,
    FIRST_M,
    LINE_CELL_M,
    LINE_CELLS,
    SLANT_MIN,
    count_cuts,
    find_heard_points,
    makes_room,
)
from perception.bayes.walls.report import room_report
from perception.bayes.walls.reported_points import ALONE_EDGE_ECHOES
from perception.shared_numbers import FAR
from tests.naive_walls import line_cuts
from tests.perception.bayes.random_tracks import P
from tests.perception.bayes.rooms import SIGMA, fill, new_room, place_wall

CORNER = np.array([2.0, 2.5])
PLACES = [np.array([x, y]) for x in (0.2, 0.6, 1.0) for y in (-0.4, 0.0, 0.4, 0.8)]
"""Where sensors hear it from."""


def mirrors() -> tuple[Memory, WallMap]:
    """Return a room of mirrors with one known wall, x = 2 from y = −1 to 1."""
    memory, room = new_room()
    place_wall(room.walls[3], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[3], -1.0, 1.0)
    room.edge_silences = 50.0
    return memory, room


def hear(room: WallMap, places: list[np.ndarray], axes: list[float], ranges: list[float]) -> None:
    """Remember readings."""
    for place, axis, range_m in zip(places, axes, ranges, strict=True):
        q = room.remembered[room.remembered_count]
        q.x, q.y = place.tolist()
        q.axis_x, q.axis_y, q.range_m = math.cos(axis), math.sin(axis), range_m
        room.remembered_count += 1


def hear_corner(room: WallMap, longer_m: float = 0.0, corner: np.ndarray = CORNER) -> None:
    """Remember a noisy echo of the corner from each place, or a range so much longer."""
    rng = np.random.default_rng(4)
    to = [corner - place for place in PLACES]
    ranges = [float(np.hypot(*d)) + longer_m + float(rng.normal(0.0, SIGMA)) for d in to]
    hear(room, PLACES, [math.atan2(d[1], d[0]) for d in to], ranges)


def used(room: WallMap) -> list[tuple[float, float]]:
    """Return the places of the inside corners among the edges."""
    return [(it.x, it.y) for it in room.edges if it.is_used == 1 and it.is_edge == 0]


def test_a_corner_that_is_heard_beyond_the_end_of_a_wall_is_found_kept_and_reported() -> None:
    memory, room = mirrors()
    hear_corner(room)
    find_heard_points(memory, P, 0)
    assert used(room) == [pytest.approx(tuple(CORNER), abs=0.05)]
    for _ in range(3):
        find_corners(memory.s)
    assert used(room) == [pytest.approx(tuple(CORNER), abs=0.01)], "placed by its echoes and the line"
    find_heard_points(memory, P, 0)
    assert len(used(room)) == 1
    reported = [corner_object(point.item()) for point in room_report(memory)[1]]
    assert [seen.model for seen in reported] == ["inside corner"]
    room.walls[3].offset += 0.5
    find_corners(memory.s)
    assert used(room) == [], "it lies on no wall's line"


@pytest.mark.parametrize("is_kept", [False, True])
def test_a_point_displaces_one_of_fewer_echoes_but_none_that_was_sure_at_the_stop(*, is_kept: bool) -> None:
    _, room = mirrors()
    room.edges[0].is_used, room.edges[0].echoes, room.edges[0].is_kept = KEPT, 3.0, int(is_kept)
    room.edges[0].x, room.edges[0].y = (CORNER + 0.5 * EDGE_SAME_M).tolist()
    found = room.edges[1]
    found.x, found.y = CORNER.tolist()
    found.echoes = 12.0
    assert makes_room(room, found, is_near=False) != is_kept
    assert room.edges[0].is_used == int(is_kept)


def test_an_edge_of_fewer_echoes_stays_where_another_one_keeps_the_point_out() -> None:
    _, room = mirrors()
    for edge, echoes in zip(room.edges[:2], (3.0, 20.0), strict=True):
        edge.is_used, edge.echoes = KEPT, echoes
        edge.x, edge.y = (CORNER + 0.5 * EDGE_SAME_M).tolist()
    found = room.edges[2]
    found.x, found.y = CORNER.tolist()
    found.echoes = 12.0
    assert not makes_room(room, found, is_near=False)
    assert room.edges[0].is_used == KEPT


def test_a_corner_that_ranges_passed_or_that_a_wall_would_be_or_that_is_known_is_none() -> None:
    memory, room = mirrors()
    hear_corner(room)
    hear_corner(room, longer_m=1.0)
    find_heard_points(memory, P, 0)
    assert used(room) == []
    memory, room = mirrors()
    beside = [np.array([x, y]) for x in (0.2, 0.6, 1.0, 1.4, 1.7) for y in (-0.4, 0.0, 0.4)]
    hear(room, beside, [math.pi / 2] * len(beside), [float(CORNER[1] - place[1]) for place in beside])
    find_heard_points(memory, P, 0)
    assert used(room) == [], "a wall across answers from its own feet"
    hear_corner(room)
    edge = room.edges[7]
    edge.is_used, edge.is_edge, edge.x, edge.y = 1, 1, CORNER[0], CORNER[1] + 0.5 * EDGE_SAME_M
    edge.echoes = 100.0
    find_heard_points(memory, P, 0)
    assert used(room) == [], "known as an edge"


def test_a_corner_of_two_walls_gets_the_echoes_that_were_heard_before_both_were_known() -> None:
    memory, room = mirrors()
    place_wall(room.walls[4], np.zeros(2), math.pi / 2, float(CORNER[1]))
    fill(memory, room.walls[4], -1.5, 0.0)
    hear_corner(room)
    find_corners(memory.s)
    corner = room.corners[0]
    assert (corner.is_used, corner.echoes) == (KEPT, 0.0)
    for turn in range(2):
        find_heard_points(memory, P, turn)
        assert used(room) == []
        assert (corner.echoes, corner.far_echoes, corner.passes) == (len(PLACES), len(PLACES), 0.0)
    find_corners(memory.s)
    assert (corner.x, corner.y) == pytest.approx(tuple(CORNER), abs=0.01)


def test_corners_too_far_away_or_where_walls_are_no_mirrors_are_not_looked_for() -> None:
    memory, room = mirrors()
    hear_corner(room, corner=np.array([2.0, 1.0 + HEARD_REACH_M + 0.3]))
    find_heard_points(memory, P, 0)
    assert used(room) == []
    memory, room = mirrors()
    room.edge_echoes = 100.0
    hear_corner(room)
    find_heard_points(memory, P, 0)
    assert used(room) == []


EDGE = np.array([2.0, 1.9])
"""The post of a doorway, beyond the known wall's end at y = 1."""
NEAR = [EDGE + np.array([-x, y]) for x in (0.4, 0.6) for y in (-0.6, -0.45, -0.3, 0.3, 0.45, 0.6)]
"""Where sensors hear it from."""


def hear_edge(room: WallMap, longer_m: float = 0.0, places: list[np.ndarray] = NEAR) -> None:
    """Remember a noisy echo of the post from each place, or a range so much longer."""
    rng = np.random.default_rng(5)
    to = [EDGE - place for place in places]
    ranges = [float(np.hypot(*d)) + longer_m + float(rng.normal(0.0, SIGMA)) for d in to]
    hear(room, places, [math.atan2(d[1], d[0]) for d in to], ranges)


def edges(room: WallMap) -> list[tuple[float, float]]:
    """Return the places of the edges that have echoes from near."""
    return [
        (it.x, it.y)
        for it in room.edges
        if it.is_used == KEPT and it.is_edge == 1 and it.echoes - it.far_echoes > 0.0
    ]


@pytest.mark.parametrize("places", [NEAR, NEAR[1::2][: int(ALONE_EDGE_ECHOES)]])
def test_the_post_across_a_doorway_is_found_kept_and_reported_though_its_wall_is_not_known(
    places: list[np.ndarray],
) -> None:
    memory, room = mirrors()
    hear_edge(room, places=places)
    find_heard_points(memory, P, 0)
    for _ in range(3):
        find_corners(memory.s)
    assert edges(room) == [pytest.approx(tuple(EDGE), abs=0.01)]
    find_heard_points(memory, P, 0)
    assert len(edges(room)) == 1
    reported = [corner_object(point.item()) for point in room_report(memory)[1]]
    assert [seen.model for seen in reported] == ["edge"]
    assert (reported[0].x, reported[0].y) == pytest.approx(tuple(EDGE), abs=0.01)
    room.walls[3].offset += 0.5
    find_corners(memory.s)
    assert edges(room) == [], "it lies on no wall's line"


def test_the_end_of_a_wall_gets_the_echoes_that_were_heard_before_the_wall_was_known() -> None:
    memory, room = mirrors()
    find_corners(memory.s)
    assert edges(room) == []
    hear(room, *shifted(np.array([0.0, 1.0 - EDGE[1]])))
    find_heard_points(memory, P, 0)
    assert edges(room) == [pytest.approx((2.0, 1.0), abs=0.01)]


def shifted(by: np.ndarray) -> tuple[list[np.ndarray], list[float], list[float]]:
    """Return places, axes and exact ranges of echoes from a point that lies so much beside the post."""
    to = [EDGE - place for place in NEAR]
    return [place + by for place in NEAR], [math.atan2(d[1], d[0]) for d in to], [float(np.hypot(*d)) for d in to]


def test_a_post_that_ranges_passed_or_that_is_heard_from_afar_or_lies_too_far_beyond_is_none() -> None:
    memory, room = mirrors()
    hear_edge(room)
    hear_edge(room, longer_m=0.5)
    find_heard_points(memory, P, 0)
    assert edges(room) == []
    memory, room = mirrors()
    hear_edge(room)
    hear_edge(room, places=[EDGE + np.array([-1.5 * EDGE_REACH_M, y]) for y in np.linspace(-0.6, 0.6, 6)])
    find_heard_points(memory, P, 0)
    assert edges(room) == [], "a corner answers from afar"
    memory, room = mirrors()
    hear(room, *shifted(np.array([0.0, 1.0 + ACROSS_M + 0.2 - EDGE[1]])))
    find_heard_points(memory, P, 0)
    assert edges(room) == [], "no doorway is so wide"
    memory, room = mirrors()
    hear_edge(room, places=NEAR[: int(EDGE_ECHOES_MIN) - 1])
    find_heard_points(memory, P, 0)
    assert edges(room) == []


def test_what_is_known_by_more_echoes_stays() -> None:
    for echoes, expected in ((1.0, tuple(EDGE)), (50.0, (2.0, EDGE[1] + 0.5 * EDGE_SAME_M))):
        memory, room = mirrors()
        known = room.edges[7]
        known.is_used, known.is_edge, known.x, known.y, known.echoes = (
            KEPT,
            1,
            2.0,
            EDGE[1] + 0.5 * EDGE_SAME_M,
            echoes,
        )
        known.heard.xx = known.heard.yy = 1e4
        known.heard.x, known.heard.y = 1e4 * known.x, 1e4 * known.y
        hear_edge(room)
        find_heard_points(memory, P, 0)
        assert edges(room) == [pytest.approx(expected, abs=0.02)]


def test_cuts_are_those_of_the_oracle() -> None:
    memory, room = mirrors()
    rng = np.random.default_rng(6)
    rows = np.column_stack([rng.uniform(0.0, 1.9, (400, 2)), rng.uniform(-1.6, 1.6, 400), rng.uniform(0.3, 3.0, 400)])
    hear(room, list(rows[:, :2]), rows[:, 2].tolist(), rows[:, 3].tolist())
    cells = np.zeros((2, LINE_CELLS))
    count_cuts(memory.s, P, 3, cells)
    cuts, ranges = line_cuts(rows, np.zeros(2), 0.0, 2.0, math.acos(P[0].cos_half_angle), SLANT_MIN)
    expected = np.zeros((2, LINE_CELLS))
    np.add.at(expected, ((ranges >= EDGE_REACH_M).astype(int), ((cuts - FIRST_M) / LINE_CELL_M).astype(int)), 1.0)
    assert len(cuts) > 20
    np.testing.assert_array_equal(cells, expected)


def test_a_corner_that_was_too_far_away_to_answer_was_not_passed() -> None:
    memory, room = mirrors()
    hear_corner(room)
    far = [CORNER - np.array([P[0].range_max_m + beyond, 0.0]) for beyond in np.linspace(0.1, 3.0, 20)]
    hear(room, far, [0.0] * len(far), [2.0 * FAR] * len(far))
    find_heard_points(memory, P, 0)
    assert len(used(room)) == 1
