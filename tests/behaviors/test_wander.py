"""Wander: the same seed is the same drive, another is another; it covers a room and touches nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from behaviors.wander import uniform
from tests.behaviors.hall import World
from tests.behaviors.mission_robot import MissionRobot, driven, length_m

ROOM = World(((1.5, 1.0, 0.3),), ((-3, -2, 3, -2), (3, -2, 3, 2), (3, 2, -3, 2), (-3, 2, -3, -2)))


def wandered(seed: int, seconds: float = 40.0) -> MissionRobot:
    use = {"name": "wander", "seed": seed, "persistence_s": 5.0}
    until = [{"when": "time", "after_s": seconds}]
    return driven({"schemas": [use], "until": until, "stuck_after_s": 60.0}, world=ROOM, seconds=seconds + 1.0)


@pytest.mark.compiled
def test_it_comes_about_and_touches_nothing_and_a_seed_repeats_it() -> None:
    robot = wandered(1)
    assert robot.status == "done"
    assert robot.clearance_m > 0.1
    assert length_m(robot.path) > 0.5 * 0.3 * 40.0
    places = np.array([(pose.x, pose.y) for pose in robot.path])
    assert (np.ptp(places, axis=0) > 1.2).all(), "it has been in many places"
    assert wandered(1).path == robot.path
    assert wandered(2, 10.0).path[-1] != robot.path[199]


def test_a_direction_is_kept_while_its_way_is_free() -> None:
    robot = driven(
        {"schemas": [{"name": "wander", "persistence_s": 4.0}], "until": [{"when": "time", "after_s": 11.9}]},
        seconds=12.0,
    )
    directions = {round(memory, 9) for memory in _directions(robot)}
    assert len(directions) == 1
    assert robot.mission.progress.memories[0].index == 3, "drawn at 0, 4 and 8 s"


def _directions(robot: MissionRobot) -> list[float]:
    return [memory.x for memory in robot.mission.progress.memories]


def test_the_numbers_are_as_if_random() -> None:
    """Mean, spread and neighbours of 4,000 numbers, against a uniform distribution's."""
    drawn = np.array([uniform(7, i) for i in range(4000)])
    assert drawn.min() >= 0.0
    assert drawn.max() < 1.0
    assert abs(drawn.mean() - 0.5) < 4.0 / math.sqrt(12.0 * len(drawn))
    assert abs(np.corrcoef(drawn[1:], drawn[:-1])[0, 1]) < 0.06
    assert len({uniform(seed, 0) for seed in range(1000)}) == 1000
