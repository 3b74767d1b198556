"""Global localisation in known rooms, on seeds that were not used for tuning.

Ten rooms here; `python -m bench localization` measures a hundred by each model of reflection.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest

from bench.trials.localization_trials import figures, localize_once
from bench.trials.random_rooms import ACOUSTICS, random_room
from config.world import AcousticsConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Firing, Pose, wrap_angle
from perception.localization.drumheller.localize import PoseCandidate, localize
from perception.localization.room.expected_ranges import Reflection
from perception.localization.room.room import make_room
from tests.perception.localization.rooms import CROOKED, RECTANGLE, RING, stand, world_of

pytestmark = pytest.mark.compiled

REFLECTIONS = pytest.mark.parametrize("reflection", ["cone", "specular"])


def noisy(reflection: Reflection) -> AcousticsConfig:
    """1 % noise, 3 % outliers, 5 % drop-outs."""
    return ACOUSTICS.model_copy(update={"model": reflection})


def is_at(candidate: PoseCandidate, pose: Pose) -> bool:
    """Whether a candidate lies within .3 ft and 3° of a pose."""
    off = math.hypot(candidate.pose.x - pose.x, candidate.pose.y - pose.y)
    return off < 0.0914 and abs(wrap_angle(candidate.pose.theta - pose.theta)) < math.radians(3.0)


@REFLECTIONS
def test_one_stand_gives_the_pose_in_random_rooms(reflection: Reflection) -> None:
    found = figures([localize_once(RING, seed, noisy(reflection)) for seed in range(10)])
    assert found.right >= 9
    assert found.wrong_alone == 0


@pytest.mark.soak
@REFLECTIONS
def test_one_stand_gives_the_pose_in_a_hundred_rooms(reflection: Reflection, measured: Callable[[str], None]) -> None:
    found = figures([localize_once(RING, seed, noisy(reflection)) for seed in range(100)])
    measured(f"{reflection}: {found.right} of {found.trials} right, {found.wrong_alone} without the right one")
    assert found.right >= 90
    assert found.wrong_alone == 0


@REFLECTIONS
def test_a_symmetric_room_gives_both_answers_their_share(reflection: Reflection) -> None:
    truth = Pose(1.5, 1.2, 0.3)
    room, firing = stand(world_of(RECTANGLE, noisy(reflection)), truth, seed=2)
    found = localize([firing], room, RING, reflection)
    for pose in (truth, Pose(5.0 - truth.x, 3.0 - truth.y, truth.theta + math.pi)):
        assert sum(one.probability for one in found if is_at(one, pose)) == pytest.approx(0.5, abs=0.05)
    assert sum(one.probability for one in found) <= 1.0 + 1e-9


@REFLECTIONS
def test_the_robot_is_lost_in_another_room(reflection: Reflection) -> None:
    room, _ = stand(world_of(RECTANGLE, noisy(reflection)), Pose(1.5, 1.2, 0.0))
    _, elsewhere = stand(world_of(CROOKED, noisy(reflection)), Pose(1.5, 2.2, 0.5))
    assert localize([elsewhere], room, RING, reflection) == ()


def test_readings_without_an_echo_are_lost() -> None:
    room, firing = stand(world_of(RECTANGLE, noisy("cone")), Pose(1.5, 1.2, 0.0))
    for nothing in (math.inf, math.nan):
        assert localize([dataclasses.replace(firing, ranges_m=np.full(24, nothing))], room, RING, "cone") == ()


@REFLECTIONS
def test_a_room_of_one_wall_has_an_area(reflection: Reflection) -> None:
    ranges_m = np.full(len(RING.mounts), 1.0)
    places = localize(
        [Firing(0.0, Pose(0.0, 0.0, 0.0), 0.0, ranges_m)],
        make_room(np.array([[0.0, 0.0, 5.0, 0.0]])),
        RING,
        reflection,
    )
    assert all(0.0 <= place.probability <= 1.0 for place in places)


def test_no_firing_is_refused() -> None:
    room, _ = stand(world_of(RECTANGLE, noisy("cone")), Pose(1.5, 1.2, 0.0))
    with pytest.raises(ValueError, match="at least one firing"):
        localize([], room, RING, "cone")


def test_the_same_readings_give_the_same_answer() -> None:
    world, truth = random_room(7)
    room, firing = stand(world, truth)
    assert localize([firing], room, RING, "specular") == localize([firing], room, RING, "specular")


def test_a_short_drive_is_placed_at_its_last_firing() -> None:
    """Octets fired on the way; odometry has its own origin, and the ring turns apart from the wheels."""
    world = world_of(CROOKED, noisy("specular"))
    scene = compile_scene(world)
    sonar = Sonar(RING, scene, world.acoustics, np.random.default_rng(5))
    odometry = Pose(-7.0, 2.0, 1.0)  # of the map's origin
    firings, truth = [], Pose(0.0, 0.0, 0.0)
    for k in range(12):
        truth = Pose(1.2 + 0.06 * k, 1.8 + 0.03 * k, 0.4 + 0.02 * k)
        at = odometry.compose(truth)
        ranges = sonar.fire(truth, truth.theta, range(k % 3, 24, 3))
        firings.append(Firing(0.2 * k, Pose(at.x, at.y, 99.0), at.theta, ranges))
    room, _ = stand(world, truth)
    found = localize(firings, room, RING, "specular")
    assert is_at(found[0], truth)
    assert found[0].probability > 0.9
