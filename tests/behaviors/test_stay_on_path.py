"""Stay-on-path: the way along a path against an oracle, and drives along paths that turn, cross, and are blocked."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from behaviors.stay_on_path import nearest_way_m, place_at
from perception.percept import Pose
from tests.behaviors.hall import World
from tests.behaviors.mission_robot import driven

CORNERS = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.5), (-0.5, 1.5))
CROSSING = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.5), (1.0, 1.5), (1.0, -1.5))


def away_from(path: tuple[tuple[float, float], ...], x: float, y: float) -> float:
    """Return the distance from a place to a path, by sampling it each centimetre."""
    samples = (
        (a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]))
        for a, b in pairwise(path)
        for s in np.linspace(0.0, 1.0, round(100.0 * math.dist(a, b)))
    )
    return min(math.dist((x, y), sample) for sample in samples)


def test_the_nearest_way_is_that_of_a_dense_search() -> None:
    rng = np.random.default_rng(3)
    ways = np.linspace(0.0, 8.0, 4001)
    for _ in range(60):
        place = (float(rng.uniform(-1, 3)), float(rng.uniform(-2, 2)))
        low = float(rng.uniform(0.0, 6.0))
        inside = [way for way in ways if low <= way <= low + 1.0]
        expected = min(math.dist(place, place_at(CROSSING, way)) for way in inside)
        found = nearest_way_m(CROSSING, place, low, low + 1.0)
        assert low - 1e-9 <= found <= low + 1.0 + 1e-9
        assert math.dist(place, place_at(CROSSING, found)) == pytest.approx(expected, abs=3e-3)


@pytest.mark.parametrize("path", [CORNERS, CROSSING], ids=["corners", "crossing itself"])
def test_it_follows_the_whole_path(path: tuple[tuple[float, float], ...]) -> None:
    use = {"name": "stay_on_path", "points_m": [list(p) for p in path], "lookahead_m": 0.5}
    robot = driven({"schemas": [use]}, seconds=60.0)
    assert robot.status == "done"
    assert math.dist((robot.pose.x, robot.pose.y), path[-1]) < 0.15
    assert max(away_from(path, pose.x, pose.y) for pose in robot.path) < 0.3
    for corner in path:
        assert min(math.dist((pose.x, pose.y), corner) for pose in robot.path) < 0.35, "no corner is left out"


def test_a_path_in_the_map_lies_where_the_map_has_it() -> None:
    use = {"name": "stay_on_path", "points_m": [[0.0, 0.0], [2.0, 0.0]], "frame": "map"}
    robot = driven({"schemas": [use]}, map_frame=Pose(0.0, 0.0, math.pi / 2), seconds=30.0)
    assert math.dist((robot.pose.x, robot.pose.y), (0.0, 2.0)) < 0.15


def test_round_something_that_stands_beside_the_path() -> None:
    use = {"name": "stay_on_path", "points_m": [[0.0, 0.0], [4.0, 0.0]]}
    robot = driven({"schemas": [use]}, world=World(((2.0, 0.5, 0.3),)), seconds=60.0)
    assert robot.status == "done"
    assert robot.clearance_m > 0.1
