"""Rooms: normals, and the sectors at corners."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.world import WorldConfig
from perception.localization.room.room import make_room, room_of

SQUARE = np.array([(0, 0, 2, 0), (2, 0, 2, 2), (2, 2, 0, 2), (0, 2, 0, 0)], dtype=float)


def test_each_corner_of_a_square_is_concave_from_inside_and_convex_from_outside() -> None:
    room = make_room(SQUARE)
    assert room.area_m2 == pytest.approx(4.0)
    assert sorted(room.corners[:, 3]) == pytest.approx([math.pi / 2] * 4 + [3 * math.pi / 2] * 4)
    inside = room.corners[room.corners[:, 3] < math.pi]
    to_middle = np.arctan2(1.0 - inside[:, 1], 1.0 - inside[:, 0])
    assert (to_middle - inside[:, 2]) % (2 * math.pi) == pytest.approx(math.pi / 4)


def test_the_points_of_a_wall_lie_at_its_offset() -> None:
    room = make_room(SQUARE)
    for k in (0, 2):
        assert (room.normals * room.walls[:, k : k + 2]).sum(axis=1) == pytest.approx(room.offsets)


@pytest.mark.parametrize(
    ("walls", "openings"),
    [
        ([(0, 0, 1, 0)], [2 * math.pi] * 2),  # an edge at either end
        ([(0, 0, 1, 0), (1, 0, 2, 0)], [2 * math.pi] * 2),  # straight on: no corner between
        ([(0, 0, 1, 0), (0, 0, 1, 0)], [2 * math.pi] * 2),  # the same wall twice
        ([(0, 0, 2, 0), (1, 0, 1, 3)], [math.pi / 2] * 2 + [2 * math.pi] * 3),  # a wall that ends on another
    ],
)
def test_sectors_between_walls(walls: list[tuple[float, ...]], openings: list[float]) -> None:
    room = make_room(np.array(walls, dtype=float))
    assert sorted(room.corners[:, 3]) == pytest.approx(openings)


@pytest.mark.parametrize(
    ("walls", "message"),
    [
        (np.empty((0, 4)), "at least one wall"),
        (np.zeros((2, 3)), "at least one wall"),
        (np.array([[0.0, 0.0, math.nan, 1.0]]), "finite"),
        (np.array([[0.0, 0.0, 1.0, 1.0], [1.0, 1.0, 1.0, 1.0]]), "wall 1 is shorter"),
    ],
)
def test_invalid_walls_are_refused(walls: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_room(walls)


def test_the_surfaces_of_a_world_are_a_room_without_those_too_short_to_be_one() -> None:
    box = {"x_m": 1.0, "y_m": 1.0, "width_m": 2.0, "depth_m": 2.0}
    speck = {"x1_m": 5.0, "y1_m": 0.0, "x2_m": 5.0005, "y2_m": 0.0}
    drum = {"x_m": 7.0, "y_m": 0.0, "radius_m": 0.3}
    room = room_of(WorldConfig.model_validate({"box": [box], "wall": [speck], "drum": [drum]}))
    assert room.walls == pytest.approx(SQUARE)
    assert room.circles == pytest.approx(np.array([[7.0, 0.0, 0.3]]))
    with pytest.raises(ValueError, match="expected at least one wall"):
        room_of(WorldConfig())
