"""The world file: an empty one is an empty hall without errors; objects are bounded in place, size and number."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from config.world import ITEMS_MAX, WallConfig, WorldConfig
from tests.config.toml_text import WORLD


def test_an_empty_world_has_no_objects_and_no_errors() -> None:
    world = WorldConfig()
    assert (world.drum, world.wall, world.box, world.polygon) == ((), (), (), ())
    assert (world.start.x_m, world.start.y_m, world.start.heading_deg) == (0.0, 0.0, 0.0)
    sound = world.acoustics
    assert {sound.noise_m, sound.noise_relative, sound.dropout, sound.outliers, sound.crosstalk} == {0.0}
    assert (sound.sound_speed_scale, world.odometry.scale) == (1.0, 1.0)


def test_every_kind_of_object_is_read() -> None:
    world = WorldConfig.model_validate(WORLD)
    assert (world.drum[0].radius_m, world.wall[0].x2_m, world.box[0].angle_deg) == (0.3, 5.0, 30.0)
    assert world.polygon[0].vertices_m == ((5.0, 5.0), (6.0, 5.0), (6.0, 6.0))


def test_the_sides_of_walls_boxes_and_polygons_are_listed() -> None:
    world = WorldConfig.model_validate(WORLD | {"box": [{"x_m": 1.0, "y_m": 2.0, "width_m": 4.0, "depth_m": 2.0}]})
    wall = world.wall[0]
    sides = world.sides_m()
    assert sides[0] == (wall.x1_m, wall.y1_m, wall.x2_m, wall.y2_m)
    assert sides[1:5] == [(-1.0, 1.0, 3.0, 1.0), (3.0, 1.0, 3.0, 3.0), (3.0, 3.0, -1.0, 3.0), (-1.0, 3.0, -1.0, 1.0)]
    assert sides[5:] == [(5.0, 5.0, 6.0, 5.0), (6.0, 5.0, 6.0, 6.0), (6.0, 6.0, 5.0, 5.0)]
    turned = world.box[0].model_copy(update={"angle_deg": 90.0})
    assert turned.corners_m()[0] == pytest.approx((2.0, 0.0))


def test_a_bent_wall_is_an_arc_with_its_middle_to_the_left() -> None:
    for bend in (0.03, -0.02, 0.3):
        wall = WallConfig(x1_m=1.0, y1_m=1.0, x2_m=1.0, y2_m=4.0, bend_m=bend)
        pieces = np.array(wall.pieces_m())
        assert pieces[0, :2].tolist() == [1.0, 1.0]
        assert pieces[-1, 2:].tolist() == [1.0, 4.0]
        np.testing.assert_array_equal(pieces[1:, :2], pieces[:-1, 2:])
        radius = (1.5**2 + bend**2) / (2.0 * bend)
        middle = 1.0 - bend + radius
        np.testing.assert_allclose(np.hypot(pieces[:, 0] - middle, pieces[:, 1] - 2.5), abs(radius), atol=1e-9)
        assert pieces[len(pieces) // 2, 0] == pytest.approx(1.0 - bend)
        assert WorldConfig(wall=(wall,)).sides_m() == wall.pieces_m()
    straight = WallConfig(x1_m=1.0, y1_m=1.0, x2_m=1.0, y2_m=4.0)
    assert straight.pieces_m() == [(1.0, 1.0, 1.0, 4.0)]


def test_a_wall_that_bends_too_far_is_refused_with_the_most_it_may() -> None:
    with pytest.raises(ValidationError, match=r"bend_m: a wall of 3 m bends by 0\.3 m at most"):
        WallConfig(x1_m=1.0, y1_m=1.0, x2_m=1.0, y2_m=4.0, bend_m=0.31)


@pytest.mark.parametrize(
    "table",
    [
        {"drum": [{"x_m": 10_001.0, "y_m": 0.0, "radius_m": 1.0}]},
        {"drum": [{"x_m": 0.0, "y_m": 0.0, "radius_m": 0.0}]},
        {"box": [{"x_m": 0.0, "y_m": 0.0, "width_m": 1.0, "depth_m": 101.0}]},
        {"polygon": [{"vertices_m": [[0.0, 0.0], [1.0, 0.0]]}]},
        {"polygon": [{"vertices_m": [[float(k), 0.0] for k in range(ITEMS_MAX + 1)]}]},
        {"wall": [{"x1_m": 0.0, "y1_m": 0.0, "x2_m": 1.0, "y2_m": 0.0}] * (ITEMS_MAX + 1)},
        {"wall": [{"x1_m": 0.0, "y1_m": 0.0, "x2_m": 1.0, "y2_m": 0.0, "surface": "velvet"}]},
        {"acoustics": {"model": "laser"}},
        {"acoustics": {"model": "rays", "rays": 0}},
        {"acoustics": {"dropout": 1.1}},
        {"start": {"heading_deg": 361.0}},
    ],
    ids=lambda table: str(table)[:60],
)
def test_a_world_beyond_the_bounds_is_refused(table: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        WorldConfig.model_validate(table)
