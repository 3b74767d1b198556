"""Corners that are heard on the line of the one wall that is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.object_report import corner_object
from perception.bayes.state import Memory
from perception.bayes.wall_contact import HEARD_REACH_M
from perception.bayes.wall_corners import find_corners
from perception.bayes.wall_points import APART_M, find_heard_corner
from perception.bayes.wall_records import WallMap
from perception.bayes.wall_report import room_report
from tests.perception.bayes.rooms import SIGMA, fill, new_room, place_wall
from tests.perception.bayes.tracks import P

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
        q = room.recent[room.recent_count].reading
        q.x, q.y = place.tolist()
        q.axis_x, q.axis_y, q.range_m = math.cos(axis), math.sin(axis), range_m
        room.recent_count += 1


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
    find_heard_corner(memory, P, 0)
    assert used(room) == [pytest.approx(tuple(CORNER), abs=0.05)]
    for _ in range(3):
        find_corners(memory.s)
    assert used(room) == [pytest.approx(tuple(CORNER), abs=0.01)], "placed by its echoes and the line"
    find_heard_corner(memory, P, 0)
    assert len(used(room)) == 1
    reported = [corner_object(point.item()) for point in room_report(memory)[1]]
    assert [seen.model for seen in reported] == ["inside corner"]
    room.walls[3].offset += 0.5
    find_corners(memory.s)
    assert used(room) == [], "it lies on no wall's line"


def test_a_corner_that_ranges_passed_or_that_a_wall_would_be_or_that_is_known_is_none() -> None:
    memory, room = mirrors()
    hear_corner(room)
    hear_corner(room, longer_m=1.0)
    find_heard_corner(memory, P, 0)
    assert used(room) == []
    memory, room = mirrors()
    beside = [np.array([x, y]) for x in (0.2, 0.6, 1.0, 1.4, 1.7) for y in (-0.4, 0.0, 0.4)]
    hear(room, beside, [math.pi / 2] * len(beside), [float(CORNER[1] - place[1]) for place in beside])
    find_heard_corner(memory, P, 0)
    assert used(room) == [], "a wall across answers from its own feet"
    hear_corner(room)
    edge = room.edges[7]
    edge.is_used, edge.is_edge, edge.x, edge.y = 1, 1, CORNER[0], CORNER[1] + 0.5 * APART_M
    find_heard_corner(memory, P, 0)
    assert used(room) == [], "known as an edge"


def test_corners_too_far_away_or_where_walls_are_no_mirrors_are_not_looked_for() -> None:
    memory, room = mirrors()
    hear_corner(room, corner=np.array([2.0, 1.0 + HEARD_REACH_M + 0.3]))
    find_heard_corner(memory, P, 0)
    assert used(room) == []
    memory, room = mirrors()
    room.edge_echoes = 100.0
    hear_corner(room)
    find_heard_corner(memory, P, 0)
    assert used(room) == []
