"""A known wall goes on beyond an opening, by echoes on its line that alone would be none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.state import Memory
from perception.bayes.wall_continuation import continue_wall, continued_wall
from perception.bayes.wall_initiation import try_wall
from perception.bayes.wall_records import IS_KNOWN, WallMap
from tests.naive_walls import Array
from tests.perception.bayes.rooms import fill, new_room, place_wall, remember_free, spans
from tests.perception.bayes.tracks import P

BESIDE = np.linspace(1.9, 2.5, 8)
"""Where the wall's other part is heard, m along it."""


def known_wall() -> tuple[Memory, WallMap]:
    """Return a wall at x = 2 that is known from y = −1 to 1."""
    memory, room = new_room()
    place_wall(room.walls[3], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[3], -1.0, 1.0)
    return memory, room


def rows(off: Array) -> Array:
    """Return readings of a surface so far behind the wall's line at the places `BESIDE`: x, y, axis, range."""
    return np.column_stack([np.full(8, 0.5), BESIDE, np.zeros(8), 1.5 + off])


def test_a_short_part_in_line_becomes_the_walls() -> None:
    memory, room = known_wall()
    remember_free(room, rows(np.zeros(8)))
    assert not try_wall(memory, P, 7), "alone it might be a barrel's side"
    assert continue_wall(memory, P, 7)
    assert spans(room.walls[3]) == pytest.approx(np.array([[-1.0, 1.0], [1.9, 2.5]]), abs=0.07)
    assert sum(room.walls[k].weight > 0.0 for k in range(16)) == 1
    assert all(room.recent[k].is_free == IS_KNOWN for k in range(8))


def test_what_does_not_lie_in_line_is_not_the_walls() -> None:
    for off in (0.3 * np.ones(8), np.tan(math.radians(12.0)) * (BESIDE - BESIDE[-1])):
        memory, room = known_wall()
        remember_free(room, rows(off))
        assert not continue_wall(memory, P, 7)
        assert len(spans(room.walls[3])) == 1


def test_only_a_wall_that_is_known_well_goes_on_and_only_beyond_its_ends() -> None:
    memory, room = known_wall()
    remember_free(room, np.array([(0.5, 2.0, 0.0, 1.5), (0.5, 0.5, 0.0, 1.5), (0.5, 2.0, 0.0, 1.8)]))
    assert [continued_wall(memory.s, P, newest) for newest in range(3)] == [3, -1, -1]
    room.walls[3].chi2 = 13.0
    assert continued_wall(memory.s, P, 0) == -1
