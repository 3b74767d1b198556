"""Approach-object: stops before the chosen object and looks at it, from the side that is asked for."""

from __future__ import annotations

import math
from typing import Any

import pytest

from behaviors.approach_object import matching
from behaviors.schema_call import Visited
from perception.percept import Pose, wrap_angle
from tests.behaviors.hall import World
from tests.behaviors.mission_robot import RADIUS_M, MissionRobot, driven, drum, mission

DRUM_M = 0.3048


def approach(**use: object) -> dict[str, Any]:
    return {"schemas": [{"name": "approach_object", "object": "drum", **use}]}


def rim_to_drum(robot: MissionRobot, x: float, y: float) -> float:
    return math.hypot(robot.pose.x - x, robot.pose.y - y) - RADIUS_M - DRUM_M


@pytest.mark.parametrize("distance_m", [0.3, 0.5, 1.0])
@pytest.mark.parametrize("start", [Pose(0.0, 0.0, 0.0), Pose(3.0, 2.0, 2.0), Pose(2.4, -1.5, 0.0)])
def test_it_stops_so_far_before_the_object_and_looks_at_it(distance_m: float, start: Pose) -> None:
    robot = driven(
        approach(distance_m=distance_m), world=World(((2.5, 0.0, DRUM_M),)), pose=start,
        objects=(drum(3, 2.5, 0.0), drum(4, 9.0, 0.0)), seconds=40.0,
    )  # fmt: skip
    assert robot.status == "done"
    assert rim_to_drum(robot, 2.5, 0.0) == pytest.approx(distance_m, abs=0.13)
    facing = math.atan2(-robot.pose.y, 2.5 - robot.pose.x)
    assert abs(wrap_angle(facing - robot.pose.theta)) < math.radians(5.0)
    assert [visited.number for visited in robot.mission.progress.visited] == [3]


@pytest.mark.parametrize("side_deg", [0.0, 60.0, 90.0, -90.0, -150.0, 180.0])
def test_it_goes_round_to_the_side_that_is_asked_for(side_deg: float) -> None:
    robot = driven(
        approach(side_deg=side_deg), world=World(((2.5, 0.0, DRUM_M),)), objects=(drum(1, 2.5, 0.0),), seconds=60.0
    )
    assert robot.status == "done"
    assert robot.clearance_m > 0.2
    side = math.atan2(robot.pose.y, robot.pose.x - 2.5)
    assert abs(wrap_angle(side - math.radians(side_deg))) < math.radians(10.0)


def test_the_unvisited_ones_are_visited_in_turn_and_then_it_waits() -> None:
    drums = (drum(1, 2.0, 0.0), drum(2, 2.0, 2.5), drum(3, -2.0, 1.0, probability=0.5))
    world = World(tuple((seen.x, seen.y, DRUM_M) for seen in drums))
    step = approach(choose="unvisited") | {"until": [{"when": "reached", "go": "a"}]}
    robot = driven(step, world=world, objects=drums, endless=True, seconds=60.0)
    assert [visited.number for visited in robot.mission.progress.visited] == [1, 2]
    assert robot.reason == "step a: no new drum is recognised near the robot"
    assert robot.status == "running"


def test_one_that_is_no_longer_recognised_is_forgotten_and_another_chosen() -> None:
    robot = MissionRobot(mission(approach()), objects=(drum(1, 6.0, 0.0),))
    robot.drive(2.0)
    robot.objects = (drum(2, 0.0, 3.0),)
    robot.drive(5.0)
    assert robot.mission.progress.memories[0].number == 1, "for a while it goes on to where it was"
    robot.drive(6.0)
    assert robot.mission.progress.memories[0].number == 2


def test_an_object_is_known_by_its_number_or_else_by_its_place() -> None:
    seen = [drum(1, 0.0, 0.0), drum(None, 3.0, 0.0), drum(2, 6.0, 0.0, probability=0.8)]
    assert matching(seen, "drum", 0.9) == seen[:2]
    assert matching(seen, "box", 0.0) == []
    visited = (Visited(1, 9.0, 9.0), Visited(None, 3.2, 0.0))
    assert matching(seen, "drum", 0.0, visited) == seen[2:]
