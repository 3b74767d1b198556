"""Where walls would meet, against the solution of two equations, and the kind of corner, by what is free there."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.wall_records import Wall
from perception.bayes.walls.crossing import crossing, is_edge, position_along, way_from
from tests import naive_walls
from tests.perception.bayes.random_tracks import examples
from tests.perception.bayes.rooms import new_room, place_wall


def put_span(wall: Wall, at: int, low: float, high: float) -> None:
    """Give a wall a span, the last one so far."""
    wall.span_count = at + 1
    wall.spans[at].low, wall.spans[at].high = low, high


@examples(60, 600)
def test_walls_that_end_near_their_crossing_have_a_corner_or_an_edge_there(examples: int) -> None:
    rng = np.random.default_rng(46)
    _, room = new_room()
    pair, kinds = (room.walls[0], room.walls[1]), []
    for _ in range(examples):
        a, turn = rng.uniform(-3, 3), rng.uniform(0.2, 2.5) * rng.choice([-1.0, 1.0])
        place, angles, ways = rng.uniform(-1, 1, 2), (a, a + turn), rng.choice([-1.0, 1.0], 2)
        for wall, normal in zip(pair, angles, strict=True):
            place_wall(wall, place, normal, float(rng.uniform(0.5, 1.5)))
        normals = [np.array([math.cos(v), math.sin(v)]) for v in angles]
        distances = [float(n @ place) + wall.offset for n, wall in zip(normals, pair, strict=True)]
        point = naive_walls.crossing(normals[0], distances[0], normals[1], distances[1])
        feet = [float(np.array([-n[1], n[0]]) @ (point - place)) for n in normals]
        for wall, foot, way in zip(pair, feet, ways, strict=True):
            near, far = sorted((foot + 0.3 * way, foot + 2.0 * way))
            put_span(wall, 0, near, far)
            if rng.random() < 0.5:  # the wall goes on behind an opening, and its middle may lie on the other side
                before, behind = (foot - 4.0, foot - 0.9) if way > 0.0 else (foot + 0.9, foot + 4.0)
                put_span(wall, 0, *min((before, behind), (near, far)))
                put_span(wall, 1, *max((before, behind), (near, far)))
            assert position_along(wall, *point.tolist()) == pytest.approx(foot, abs=1e-9)
            assert way_from(wall, foot) == way
        leaving = [v + way * math.pi / 2 for v, way in zip(angles, ways, strict=True)]
        kind = naive_walls.is_edge(leaving[0], angles[0], leaving[1], angles[1])
        is_corner, *found = crossing(*pair)
        assert is_corner == (abs(math.sin(turn)) > 0.4 and kind is not None)
        if is_corner:
            assert found == pytest.approx(point, abs=1e-9)
            assert is_edge(*pair, *found) == is_edge(*pair[::-1], *found) == kind
        kinds.append(kind if is_corner else None)
        put_span(pair[1], 0, feet[1] - 1.0, feet[1] + 1.0)
        assert not crossing(*pair)[0], "one of them goes on there"
    assert {None, False, True} == set(kinds)
