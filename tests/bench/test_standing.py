"""Tests of bench.standing: what counts as lost, moved and false."""

from __future__ import annotations

import math

import pytest

from bench.standing import KINDS, RINGS, is_true, moved_m, ring_of_room
from config.world import DrumConfig, WallConfig, WorldConfig
from perception.detected_object import DetectedObject

WORLD = WorldConfig(
    wall=(WallConfig(x1_m=0.0, y1_m=0.0, x2_m=4.0, y2_m=0.0), WallConfig(x1_m=4.0, y1_m=0.0, x2_m=4.0, y2_m=3.0)),
    drum=(DrumConfig(x_m=2.0, y_m=1.5, radius_m=0.3),),
)


def wall(x1: float, y1: float, x2: float, y2: float) -> DetectedObject:
    tx, ty = x2 - x1, y2 - y1
    covariance = (tx * tx / 12.0, tx * ty / 12.0, ty * ty / 12.0)
    middle, theta = (0.5 * (x1 + x2), 0.5 * (y1 + y2)), math.atan2(ty, tx)
    return DetectedObject("wall", *middle, theta, 0.01, 9, 1.0, 1.0, covariance)


def point(model: str, x: float, y: float) -> DetectedObject:
    return DetectedObject(model, x, y, 0.0, 0.01, 9, 1.0, 1.0)


def test_a_wall_is_where_nine_tenths_of_it_are_and_a_point_where_the_nearest_of_its_kind_is() -> None:
    before = wall(0.0, 0.0, 4.0, 0.0)
    assert moved_m(before, [wall(0.0, 0.02, 2.0, 0.02), wall(2.1, 0.0, 3.8, 0.0)]) == pytest.approx(0.02)
    assert moved_m(before, [wall(0.0, 0.0, 3.0, 0.0)]) > 0.5
    assert moved_m(before, [point("edge", 2.0, 0.0)]) == math.inf
    assert moved_m(point("edge", 1.0, 1.0), [point("edge", 1.0, 1.3), point("drum", 1.0, 1.0)]) == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("one", "is_right"),
    [
        (wall(0.5, 0.05, 3.5, 0.05), True),
        (wall(0.0, 0.0, 4.0, 1.0), False),
        (wall(3.0, 0.0, 6.0, 0.0), False),
        (wall(3.95, 0.2, 3.95, 0.4), True),
        (point("inside corner", 4.05, 0.05), True),
        (point("edge", 4.0, 0.0), False),
        (point("edge", 4.0, 3.0), True),
        (point("inside corner", 2.0, 0.0), False),
        (point("drum", 2.1, 1.5), True),
        (point("drum", 2.3, 1.5), False),
    ],
)
def test_an_object_is_true_where_its_like_stands(one: DetectedObject, is_right: bool) -> None:
    assert one.model in KINDS
    assert is_true(one, WORLD) == is_right


def test_each_room_has_its_ring() -> None:
    rings = [ring_of_room(seed) for seed in range(2 * len(RINGS))]
    assert rings[0] == rings[len(RINGS)]
    assert len({len(ring.mounts) for ring in rings}) > 3
