"""Turn: on the spot, the short way, to a heading from where the step began, of odometry, or of the map."""

from __future__ import annotations

import math

import pytest

from behaviors.turn import ALIGNED_RAD, UNKNOWN_FRAME
from perception.percept import Pose, wrap_angle
from tests.behaviors.mission_robot import MissionRobot, driven, mission


@pytest.mark.parametrize(
    ("relative_to", "start", "map_frame", "expected"),
    [
        ("robot", 0.3, None, 0.3 + math.pi / 2),
        ("odom", 2.5, None, math.pi / 2),
        ("odom", -3.0, None, math.pi / 2),
        ("map", 0.0, Pose(5.0, 5.0, -1.0), math.pi / 2 - 1.0),
    ],
)
def test_it_looks_that_way_and_stays_where_it_is(
    relative_to: str, start: float, map_frame: Pose | None, expected: float
) -> None:
    use = {"name": "turn", "heading_deg": 90.0, "relative_to": relative_to}
    robot = driven({"schemas": [use]}, pose=Pose(1.0, 2.0, start), map_frame=map_frame, seconds=15.0)
    assert robot.status == "done"
    assert abs(wrap_angle(robot.pose.theta - expected)) <= ALIGNED_RAD + 0.05
    assert (robot.pose.x, robot.pose.y) == (1.0, 2.0)
    assert sum(abs(b.theta - a.theta) for a, b in zip(robot.path, robot.path[1:], strict=False)) < math.pi + 0.3


def test_without_a_place_in_the_map_it_waits_and_says_so() -> None:
    use = {"name": "turn", "heading_deg": 90.0, "relative_to": "map"}
    robot = MissionRobot(mission({"schemas": [use]}))
    robot.cycle()
    assert UNKNOWN_FRAME in robot.reason
    assert robot.drive(60.0).status == "running", "waiting is not being stuck"
