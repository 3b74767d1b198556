"""Tests of the random halls: one hall a seed, nothing overlaps, and the path is free.

Recognition in them is tested in tests/perception/bayes/test_random_halls.py.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_settings
from config.units import FOOT_M
from runtime.simulation.random_halls import ACOUSTICS, BARREL, BOX, DRUM, POST, STEP, random_hall

BODY_M = load_settings("hallway").body.radius_m


@pytest.mark.parametrize("seed", range(12))
def test_a_hall_has_eight_drums_and_three_others_that_overlap_neither_each_other_nor_the_path(seed: int) -> None:
    world, path = random_hall(seed)
    radii = sorted(round(d.radius_m / FOOT_M, 9) for d in world.drum)
    assert radii == sorted([DRUM] * 8 + [POST, BARREL])
    (box,) = world.box
    placed = [(d.x_m, d.y_m, d.radius_m) for d in world.drum] + [(box.x_m, box.y_m, BOX * FOOT_M)]
    for i, (x, y, radius) in enumerate(placed):
        assert all(math.dist((x, y), other[:2]) > radius + other[2] for other in placed[:i])
        assert min(math.dist((x, y), at[:2]) for at in path) > radius + BODY_M
    (room,) = world.polygon
    xs, ys = np.array(room.vertices_m).T
    assert all(min(xs) < x < max(xs) and min(ys) < y < max(ys) for x, y, _ in (*placed, *path))
    assert world.acoustics == ACOUSTICS


def test_the_seed_determines_the_hall() -> None:
    assert random_hall(3) == random_hall(3)
    assert random_hall(3) != random_hall(4)


def test_the_ring_fires_every_step_along_the_path() -> None:
    world, path = random_hall(0)
    steps = np.diff([x for x, _, _ in path])
    assert steps == pytest.approx(np.full(len(path) - 1, STEP * FOOT_M))
    assert world.start.x_m == pytest.approx(path[0][0])
    assert len({yaw for _, _, yaw in path}) == 1
