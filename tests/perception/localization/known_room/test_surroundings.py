"""Expected ranges of the kernels against numpy's, and the lists of what is near."""

from __future__ import annotations

import math
from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from bench.trials.furnished_rooms import furnished_room
from perception.localization.known_room.mirror_points import expect_specular
from perception.localization.known_room.surroundings import (
    FRINGE_RAD,
    NEAR_MAX,
    expect_cone,
    insert_nearest,
    look_around,
    make_surroundings,
)
from perception.localization.room.expected_ranges import Beams, Expected, Reflection, expected_ranges
from perception.localization.room.range_likelihood import RangeModel
from perception.localization.room.room import make_room, room_of
from tests.perception.localization.rooms import HALF_ANGLE, RING

MODEL = RangeModel.of_ring(RING)
BEAMS = 40


def assert_is(found: list[tuple[float, float, float]], oracle: Expected, heard: NDArray[np.bool_]) -> None:
    """Expected ranges and their derivatives are the oracle's where it hears something, and silence elsewhere."""
    range_m, grad_x, grad_y = np.array(found).T
    assert range_m[heard] == pytest.approx(oracle.range_m[heard])
    assert (range_m[~heard] > MODEL.window_m).all()
    assert grad_x[heard] == pytest.approx(oracle.grad_x[heard], abs=1e-9)
    assert grad_y[heard] == pytest.approx(oracle.grad_y[heard], abs=1e-9)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_expected_ranges_are_numpys(seed: int) -> None:
    room = room_of(furnished_room(seed).world)
    around = make_surroundings(room, MODEL, HALF_ANGLE)
    rng = np.random.default_rng(seed)
    (x, y), axis = rng.uniform(*room.bounds, (BEAMS, 2)).T, rng.uniform(-4.0, 4.0, BEAMS)
    cone, mirror = (expected_ranges(room, Beams(x, y, axis), HALF_ANGLE, one) for one in get_args(Reflection))
    wider = expected_ranges(room, Beams(x, y, axis), HALF_ANGLE + FRINGE_RAD, "specular")
    rough, inside, beside, alone = [], [], [], []
    for k in range(BEAMS):
        look_around(around, x[k] + 0.2, y[k] - 0.1, 0.3)
        at = float(x[k]), float(y[k]), math.cos(axis[k]), math.sin(axis[k])
        rough.append(expect_cone(around, *at))
        inner, outer = expect_specular(around, *at, around.sensor[0].cos_fringe)
        inside.append(inner)
        beside.append(outer)
        alone.append(expect_specular(around, *at, around.sensor[0].cos_half))
    assert_is(rough, cone, cone.range_m <= MODEL.window_m)
    assert_is(inside, mirror, mirror.range_m <= MODEL.window_m)
    # The nearest mirror of the wider beam is beside the beam where the beam's own nearest one is farther away.
    is_beside = (wider.range_m <= MODEL.window_m) & (wider.range_m < mirror.range_m - 1e-9)
    assert 0 < is_beside.sum() < BEAMS
    assert_is(beside, wider, is_beside)
    assert alone == [(inner, (math.inf, 0.0, 0.0)) for inner in inside]


def test_what_is_near_is_listed_nearest_first() -> None:
    x = np.arange(0.0, 40.0, 0.5)
    walls = np.column_stack([x, 0.0 * x, x, 0.0 * x + 0.3])
    around = make_surroundings(make_room(walls, np.array([[20.0, 5.0, 1.0]])), MODEL, HALF_ANGLE)
    look_around(around, 20.1, 0.1, 0.2)
    near = around.near[0]
    listed = near.wall_m[: near.wall_count]
    assert (np.diff(listed) >= 0.0).all()
    assert listed == pytest.approx(np.sort(np.abs(x - 20.1))[: near.wall_count])
    assert listed[-1] <= MODEL.window_m + 0.2 < np.sort(np.abs(x - 20.1))[near.wall_count]
    assert (near.circle_count, near.circle_m[0]) == (1, pytest.approx(math.hypot(0.1, 4.9) - 1.0))
    ends = near.corners[: near.corner_count]
    assert np.abs(walls[ends // 2, 0] - 20.1).max() < 1.3  # two ends a wall, which answer from near only


def test_a_full_list_keeps_the_nearest() -> None:
    indices, distances, count = np.zeros(NEAR_MAX, dtype=np.int64), np.zeros(NEAR_MAX), 0
    away = np.random.default_rng(0).permutation(NEAR_MAX + 40).astype(np.float64)
    for k, distance in enumerate(away.tolist()):
        count = insert_nearest(indices, distances, count, k, distance)
    assert count == NEAR_MAX
    assert distances == pytest.approx(np.arange(NEAR_MAX))
    assert away[indices] == pytest.approx(distances)
