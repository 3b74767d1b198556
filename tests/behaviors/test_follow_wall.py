"""Follow-wall: keeps its distance along walls, inside and outside corners, and past openings too narrow for it."""

from __future__ import annotations

import math

import pytest

from perception.percept import Pose
from tests.behaviors.hall import World
from tests.behaviors.mission_robot import RADIUS_M, MissionRobot, driven

ROOM = World((), ((-3, -2, 3, -2), (3, -2, 3, 2), (3, 2, -3, 2), (-3, 2, -3, -2)))
BLOCK = World((), ((-1, -1, 1, -1), (1, -1, 1, 1), (1, 1, -1, 1), (-1, 1, -1, -1)))


def followed(world: World, pose: Pose, side: str, way_m: float) -> MissionRobot:
    use = {"name": "follow_wall", "side": side, "distance_m": 0.5}
    until = [{"when": "way", "after_m": way_m}]
    return driven({"schemas": [use], "until": until}, world=world, pose=pose, seconds=120.0)


def turned(robot: MissionRobot) -> float:
    return robot.path[-1].theta - robot.path[0].theta


@pytest.mark.compiled
@pytest.mark.parametrize(("side", "sign"), [("left", -1.0), ("right", 1.0)])
def test_round_a_room_by_its_inside_corners(side: str, sign: float) -> None:
    robot = followed(ROOM, Pose(0.0, 1.0 * -sign, 0.0), side, 14.0)
    assert robot.status == "done"
    assert robot.clearance_m > 0.2
    assert sign * turned(robot) > 1.8 * math.pi, "once round"
    gaps = [ROOM.clearance(pose.x, pose.y) - RADIUS_M for pose in robot.path[100:]]
    assert max(gaps) < 0.8
    assert sorted(gaps)[len(gaps) // 2] == pytest.approx(0.5, abs=0.1)


@pytest.mark.compiled
def test_round_a_block_by_its_outside_corners() -> None:
    robot = followed(BLOCK, Pose(0.0, -1.9, 0.0), "left", 13.0)
    assert robot.status == "done"
    assert turned(robot) > 1.7 * math.pi
    gaps = [BLOCK.clearance(pose.x, pose.y) - RADIUS_M for pose in robot.path[60:]]
    assert min(gaps) > 0.2
    assert max(gaps) < 0.9


def test_past_an_opening_that_is_too_narrow_and_ahead_where_there_is_no_wall() -> None:
    opening = World((), ((-1, 1, 2, 1), (2.7, 1, 9, 1)))
    robot = followed(opening, Pose(0.0, 0.0, 0.0), "left", 5.0)
    assert robot.status == "done"
    assert max(abs(pose.y) for pose in robot.path) < 0.35
    free = followed(World(), Pose(0.0, 0.0, 1.0), "left", 1.0)
    assert {pose.theta for pose in free.path} == {1.0}
