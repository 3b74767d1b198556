"""The noise estimated from walls, against the truth and against least squares."""

from __future__ import annotations

import numpy as np
import pytest

from perception.bayes.walls import noise as wall_noise
from perception.bayes.walls.contact import range_sigma
from tests.perception.bayes.random_tracks import P, examples
from tests.perception.bayes.rooms import fill, new_room, place_wall


@examples(4, 40)
def test_the_noise_of_a_walls_echoes_is_found(examples: int) -> None:
    rng = np.random.default_rng(49)
    for _ in range(examples):
        memory, room = new_room()
        wall = room.walls[0]
        place_wall(wall, np.zeros(2), 0.0, 2.0)
        absolute, relative = rng.uniform(0.002, 0.01), rng.uniform(0.005, 0.02)
        for _ in range(800):
            r = rng.uniform(0.4, 4.0)
            error = float(rng.normal(0.0, np.hypot(absolute, relative * r)))
            wall_noise.add_residual(room, wall, error, 0.0, r)
            wall_noise.estimate_noise(memory.s, P)
            room.firings += 1
        for r in (0.7, 1.5, 3.0):
            assert range_sigma(room, r) == pytest.approx(np.hypot(absolute, relative * r), rel=0.25)


def test_an_uncertain_wall_says_nothing_of_the_noise() -> None:
    memory, room = new_room()
    wall = room.walls[0]
    place_wall(wall, np.zeros(2), 0.0, 2.0)
    wall.variance_slope = 0.01
    wall_noise.estimate_noise(memory.s, P)
    before = room.variance_m2, room.relative_variance
    for _ in range(100):
        wall_noise.add_residual(room, wall, 0.3, 1.0, 2.0)
    room.firings = 1
    wall_noise.estimate_noise(memory.s, P)
    assert (room.variance_m2, room.relative_variance) == before


def test_the_echoes_of_all_bins_are_weighed_by_the_present_noise() -> None:
    memory, room = new_room()
    wall = room.walls[0]
    place_wall(wall, np.zeros(2), 0.0, 2.0)
    fill(memory, wall, -0.6, 0.6, 4.0, 1.5)
    error = wall.offset
    wall_noise.change_noise(room, 0.002**2, 0.01**2)
    assert wall.bins[96].precision == pytest.approx(4.0 / (0.002**2 + 0.015**2))
    assert wall.bins[96].offset_sum / wall.bins[96].precision == pytest.approx(error)
    assert wall.bins[96].weight == 4.0
