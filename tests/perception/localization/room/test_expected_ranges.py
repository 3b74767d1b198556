"""Expected ranges against the oracles of the emulator's acoustics, which share no code with either."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.trials.furnished_rooms import drive, furnished_room
from bench.trials.random_rooms import random_room
from config.world import WorldConfig
from drivers.emulator.acoustics import SIGHT_SLACK_M
from drivers.messages import Pose
from perception.bayes.memory.polygon_parameters import EDGE_REACH_M
from perception.localization.room.expected_ranges import Beams, Reflection, crossed, expected_ranges
from perception.localization.room.room import make_room, room_of
from tests import naive_acoustics
from tests.perception.localization.rooms import HALF_ANGLE, RING, beams_of, panorama_of, stand


def places(rooms: int = 6) -> list[tuple[WorldConfig, Pose]]:
    """Rooms of walls with a stand each, and rooms with drums in them."""
    with_drums = [(seed, furnished_room(seed)) for seed in range(3 * rooms) if furnished_room(seed).world.drum][
        :rooms
    ]
    clear = [(room.world, Pose(*drive(room, seed, 0.5, 1.0)[0].tolist())) for seed, room in with_drums]
    return [*(random_room(seed) for seed in range(rooms)), *clear]


@pytest.mark.covered
@pytest.mark.parametrize("reflection", ["cone", "specular"])
def test_ranges_equal_their_oracle(reflection: Reflection) -> None:
    silent = 0
    for world, truth in places():
        shapes, room = naive_acoustics.shapes_of(world), room_of(world)
        beams = beams_of(panorama_of(stand(world, truth)[1]), truth, Pose(truth.x + 0.1, truth.y, 1.0))
        found = expected_ranges(room, beams, HALF_ANGLE, reflection).range_m
        for place, x, y, axis in zip(np.ndindex(found.shape), *(part.flat for part in beams), strict=True):
            sensor = complex(x, y)
            if reflection == "cone":
                expected = naive_acoustics.cone(shapes, sensor, axis, HALF_ANGLE)
            else:
                expected = naive_acoustics.specular(shapes, sensor, axis, HALF_ANGLE, EDGE_REACH_M, SIGHT_SLACK_M)
            silent += math.isinf(expected)
            assert found[place] == pytest.approx(expected, abs=1e-9)
    assert silent > 0


@pytest.mark.covered
@pytest.mark.parametrize("reflection", ["cone", "specular"])
def test_gradients_are_those_of_the_range(reflection: Reflection) -> None:
    step = 1e-6
    for world, truth in places():
        room, firing = stand(world, truth)
        beams = beams_of(panorama_of(firing), truth)
        found = expected_ranges(room, beams, HALF_ANGLE, reflection)
        for dx, dy, gradient in ((step, 0.0, found.grad_x), (0.0, step, found.grad_y)):
            plus, minus = (
                expected_ranges(room, Beams(beams.x + k * dx, beams.y + k * dy, beams.axis), HALF_ANGLE, reflection)
                for k in (1, -1)
            )
            heard = np.isfinite(plus.range_m) & np.isfinite(minus.range_m)
            change = plus.range_m[heard] - minus.range_m[heard]
            assert gradient[heard] == pytest.approx(change / (2.0 * step), abs=1e-4)
            assert (gradient[np.isinf(found.range_m)] == 0.0).all()
    assert len(RING.mounts) == found.range_m.size


def test_a_sensor_that_faces_no_wall_expects_silence() -> None:
    room = make_room(np.array([(0.0, -1.0, 0.0, 1.0)]))
    beams = Beams(np.array([1.0, 1.0]), np.array([0.0, 0.0]), np.array([0.0, math.pi]))
    for reflection in ("cone", "specular"):
        assert expected_ranges(room, beams, HALF_ANGLE, reflection).range_m.tolist() == [math.inf, 1.0]


def test_a_line_of_sight_is_crossed_only_before_its_end() -> None:
    room = make_room(np.array([(1.0, -1.0, 1.0, 1.0)]))
    to_x = np.array([0.9, 1.05, 1.2, -3.0])
    zero = np.zeros(4)
    assert crossed(room, zero, zero, to_x, zero, 0.1).tolist() == [False, False, True, False]
    assert not crossed(room, zero, zero + 2.0, to_x, zero + 2.0, 0.1).any()
