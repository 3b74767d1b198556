"""Worlds with a box canyon: their sizes, that the straight way leads in, and the shortest way round."""

from __future__ import annotations

import math

import pytest

from config.world import WorldConfig
from drivers.messages import Pose
from runtime.simulation.canyon_worlds import DEPTH_M, WIDTH_M, CanyonWorld, canyon_world


def test_the_straight_way_leads_through_the_mouth_to_the_back() -> None:
    for seed in range(40):
        place = canyon_world(seed)
        assert DEPTH_M[0] <= place.depth_m <= DEPTH_M[1]
        assert WIDTH_M[0] <= place.width_m <= WIDTH_M[1]
        (u0, v0), (u1, v1) = place.local(place.start.x, place.start.y), place.local(*place.goal)
        assert u0 < 0.0 < place.depth_m < u1
        for u in (0.0, place.depth_m):
            assert abs(v0 + (v1 - v0) * (u - u0) / (u1 - u0)) < 0.5 * place.width_m
        assert canyon_world(seed) == place


def test_the_goal_is_given_as_odometry_sees_it() -> None:
    place = canyon_world(3)
    x, y = place.goal_in_odometry()
    seen = place.start.compose(Pose(x, y, 0.0))
    assert (seen.x, seen.y) == pytest.approx(place.goal)


def test_the_shortest_way_is_straight_pieces_and_arcs() -> None:
    start = WorldConfig().start.model_copy(update={"x_m": -2.0})
    place = CanyonWorld(WorldConfig(start=start), 3.0, 2.0, Pose(0.0, 0.0, 0.0), (5.0, 0.0))
    assert place.shortest_m(0.0) == pytest.approx(3.0 + 2.0 * math.hypot(2.0, 1.0))
    reach, off = math.hypot(2.0, 1.0), math.atan2(1.0, 2.0)
    tangent = math.sqrt(reach**2 - 0.5**2)
    arc = 0.5 * (off + math.asin(0.5 / reach))
    assert place.shortest_m(0.5) == pytest.approx(3.0 + 2.0 * (tangent + arc), abs=1e-3)
