"""The sonar barrier test."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.trials.random_rooms import random_room
from config.world import AcousticsConfig
from drivers.messages import Pose
from perception.localization.drumheller.barrier import blocked_share
from perception.localization.room.expected_ranges import Reflection
from tests.perception.localization.rooms import HALF_ANGLE, beams_of, panorama_of, stand


@pytest.mark.parametrize("reflection", ["cone", "specular"])
def test_the_true_pose_passes_and_an_echo_from_behind_a_wall_counts(reflection: Reflection) -> None:
    for seed in range(6):
        world, truth = random_room(seed, AcousticsConfig(model=reflection))
        room, firing = stand(world, truth)
        panorama = panorama_of(firing)
        beams = beams_of(panorama, truth)
        ranges = firing.ranges_m.copy()
        (share,) = blocked_share(room, beams, ranges, HALF_ANGLE)
        assert share <= 0.15
        heard = np.flatnonzero(np.isfinite(ranges))
        ranges[heard] = 20.0
        assert blocked_share(room, beams, ranges, HALF_ANGLE) == pytest.approx([1.0])


def test_most_poses_behind_the_walls_fail() -> None:
    world, truth = random_room(3, AcousticsConfig(model="cone"))
    room, firing = stand(world, truth)
    panorama = panorama_of(firing)
    outside = [Pose(truth.x + 8.0 * math.cos(a), truth.y + 8.0 * math.sin(a), truth.theta + a) for a in range(7)]
    shares = blocked_share(room, beams_of(panorama, truth, *outside), firing.ranges_m, HALF_ANGLE)
    assert shares[0] == 0.0
    assert shares.shape == (8,)


def test_silence_is_not_tested() -> None:
    world, truth = random_room(3)
    room, firing = stand(world, truth)
    beams = beams_of(panorama_of(firing), truth)
    assert blocked_share(room, beams, np.full(24, math.inf), HALF_ANGLE).tolist() == [0.0]
