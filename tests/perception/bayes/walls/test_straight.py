"""The line of a sure wall, its spans and ends, as they are reported."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from perception.bayes.memory.state import Memory
from perception.bayes.memory.wall_records import WALL_BINS, WallMap
from perception.bayes.walls.straight import Straight, reported_line, straight
from tests.perception.bayes.rooms import fill, new_room, place_wall


def reviewed_wall(*parts: tuple[float, float]) -> tuple[Memory, WallMap]:
    """Return a wall at x = 2 with these parts, of which a review found nothing yet."""
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    for low, high in parts:
        fill(memory, room.walls[0], low, high)
    room.walls[0].reviewed.information = 1.0
    for b in range(WALL_BINS):
        room.walls[0].bins[b].is_held = 0
    return memory, room


def hold(room: WallMap, low: float, high: float) -> None:
    """Let a review find that the first wall covers this."""
    for b in range(round(low / 0.06) + 96, round(high / 0.06) + 96):
        room.walls[0].bins[b].is_held = 1


def wall_of(memory: Memory) -> Straight:
    """Return the first wall with all its spans, as the last review leaves it."""
    wall: Any = memory.state["room"]["walls"][0, 0]
    found = straight(wall, wall["spans"][: wall["span_count"]])
    found.hold_to_review()
    return found


def test_spans_go_as_far_as_the_review_found_and_are_one_where_it_found_no_gap() -> None:
    memory, room = reviewed_wall((-2.4, -1.2), (0.0, 1.2))
    hold(room, -2.1, -0.9)
    hold(room, 0.0, 1.5)
    assert wall_of(memory).ends == pytest.approx(np.array([[-2.1, -0.9], [0.0, 1.5]]))
    hold(room, -0.6, 0.0)
    assert wall_of(memory).ends == pytest.approx(np.array([[-2.1, 1.5]])), "a gap of five bins is none"
    room.walls[0].reviewed.information = 0.0
    assert wall_of(memory).ends == pytest.approx(np.array([[-2.4, -1.2], [0.0, 1.2]])), "not reviewed"


def test_echoes_of_its_posts_do_not_close_an_opening() -> None:
    memory, room = reviewed_wall((-1.2, 1.2))
    for low, high in ((-1.2, -0.36), (-0.18, -0.06), (0.12, 0.18), (0.36, 1.2)):
        hold(room, low, high)
    assert wall_of(memory).ends == pytest.approx(np.array([[-1.2, 1.2]])), "nothing was seen between"
    for b in range(96 - 6, 96 + 6):
        room.walls[0].bins[b].is_open = 1 - room.walls[0].bins[b].is_held
    assert wall_of(memory).ends == pytest.approx(np.array([[-1.2, -0.36], [0.36, 1.2]]))


def test_a_span_of_which_little_is_left_is_none() -> None:
    memory, room = reviewed_wall((-1.2, 1.2))
    assert len(wall_of(memory).ends) == 0
    hold(room, 0.0, 0.24)
    assert len(wall_of(memory).ends) == 0
    hold(room, 0.24, 0.3)
    assert wall_of(memory).ends == pytest.approx(np.array([[0.0, 0.3]]))


def test_what_no_span_is_near_is_left_out() -> None:
    memory, room = reviewed_wall((-1.2, 1.2))
    hold(room, -1.2, 1.2)
    hold(room, 2.4, 3.6)
    assert wall_of(memory).ends == pytest.approx(np.array([[-1.2, 1.2]]))


def test_the_line_is_that_of_more_information() -> None:
    memory, room = reviewed_wall((-1.2, 1.2))
    wall: Any = memory.state["room"]["walls"][0, 0]
    reviewed = wall["reviewed"]
    room.walls[0].variance_offset, room.walls[0].covariance, room.walls[0].variance_slope = 1e-5, 0.0, 1e-4
    reviewed["offset"], reviewed["slope"] = 2.01, 0.02
    for information, offset in ((0.9e9, 2.0), (1.1e9, 2.01)):
        reviewed["information"] = information
        assert reported_line(wall)[0] == pytest.approx(offset)


def test_a_point_beyond_an_end() -> None:
    memory, room = reviewed_wall((-2.4, -1.2), (0.0, 1.2))
    hold(room, -2.4, -1.2)
    hold(room, 0.0, 1.2)
    of = wall_of(memory)
    assert of.point(0.5) == pytest.approx((2.0, 0.5))
    for y, gap, end in ((-0.3, 0.3, (1, 0)), (-1.3, -0.1, (0, 1))):
        along, beyond, at = of.beyond(2.0, y)
        assert (along, beyond) == pytest.approx((y, gap))
        assert at == end
