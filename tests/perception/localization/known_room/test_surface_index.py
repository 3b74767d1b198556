"""The index of surfaces: what it lists near a place is all that a search through the whole room finds."""

from __future__ import annotations

import numpy as np

from perception.localization.known_room.surface_index import WALLS, WITHIN_M, listed
from perception.localization.known_room.surroundings import look_around, make_surroundings
from perception.localization.room.range_likelihood import RangeModel
from perception.localization.room.room import make_room
from tests.perception.localization.rooms import HALF_ANGLE

MODEL = RangeModel(0.03, 3.0)


def test_what_is_listed_is_all_that_is_near_and_little_else() -> None:
    rng = np.random.default_rng(0)
    begin = rng.uniform(0.0, 60.0, (300, 2))
    walls = np.column_stack([begin, begin + rng.uniform(0.1, 3.0, (300, 2))])
    circles = np.column_stack([rng.uniform(0.0, 60.0, (200, 2)), rng.uniform(0.1, 0.5, 200)])
    around = make_surroundings(make_room(walls, circles), MODEL, HALF_ANGLE)
    near = around.near[0]
    for x, y in rng.uniform(1.0, 59.0, (50, 2)).tolist():
        first, end = listed(around.bins, around.starts, WALLS, x, y, WITHIN_M)
        assert 0 <= end - first < 150
        look_around(around, x, y, 0.5)
        some = [near.walls[: near.wall_count].tolist(), near.circles[: near.circle_count].tolist()]
        distances = np.hypot(circles[:, 0] - x, circles[:, 1] - y) - circles[:, 2]
        assert sorted(some[1]) == np.flatnonzero(distances <= MODEL.window_m + 0.5).tolist()
        look_around(around, x, y, WITHIN_M + 0.1)  # beyond the index: all are searched
        every = near.walls[: near.wall_count][near.wall_m[: near.wall_count] <= MODEL.window_m + 0.5].tolist()
        assert some[0] == every


def test_a_place_outside_is_not_in_the_index() -> None:
    around = make_surroundings(make_room(np.array([[0.0, 0.0, 5.0, 0.0]])), MODEL, HALF_ANGLE)
    assert listed(around.bins, around.starts, WALLS, -1.0, 0.5, 0.0) == (-1, -1)
    look_around(around, -1.0, 0.5, 0.0)
    assert around.near[0].wall_count == 1
