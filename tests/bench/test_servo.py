"""Stands and drives of a sensor on a servo: the scenes are what they say, and a stand finds what is there."""

from __future__ import annotations

import pytest

from bench.servo import measure_stands, stand_scene


def test_a_scene_has_the_points_that_it_names() -> None:
    world, points = stand_scene(3, "cone")
    assert (len(world.drum), len(world.wall), len(points)) == (2, 2, 4)
    for drum, point in zip(world.drum, points[::2], strict=True):
        assert abs(complex(drum.x_m, drum.y_m)) - drum.radius_m == pytest.approx(abs(point))


@pytest.mark.parametrize(("stands", "least"), [(1, 3), pytest.param(2, 7, marks=pytest.mark.soak)])
def test_a_servo_finds_at_a_stand_what_the_ring_of_the_denning_finds_and_more(stands: int, least: int) -> None:
    rows = measure_stands(range(stands), lambda _: None)
    for model in ("specular", "cone"):
        servo, denning = rows[f"stand: servo1, {model}"], rows[f"stand: denning, {model}"]
        assert servo["found"] >= max(least, denning["found"])
        assert servo["false"] == 0
