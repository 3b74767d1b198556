"""Every schema that a step can name has a function, and those of legs and goals drive in a step as they do alone."""

from __future__ import annotations

import math
from typing import Any

import pytest

from behaviors.memory.goal_place import GOAL_SLEW_M_S
from behaviors.schema_registry import SCHEMAS
from config.schema_use import SHIPPED_USES
from perception.percept import Pose
from tests.behaviors.hall import STEP_S
from tests.behaviors.mission_robot import MissionRobot, driven, mission, moved


def test_every_name_has_settings_and_a_function() -> None:
    assert SHIPPED_USES.keys() == SCHEMAS.keys()


@pytest.mark.parametrize(
    ("use", "expected"),
    [
        ({"direction_deg": 90.0, "distance_m": 1.0}, (0.0, 1.0)),
        ({"direction_deg": 180.0, "distance_m": 0.5}, (-0.5, 0.0)),
        ({"direction_deg": 90.0, "distance_m": 1.0, "relative_to": "odom"}, (0.0, 1.0)),
    ],
)
@pytest.mark.parametrize("theta", [0.0, 2.0])
def test_ahead_for_a_distance(use: dict[str, Any], expected: tuple[float, float], theta: float) -> None:
    robot = driven({"schemas": [{"name": "move_ahead", **use}]}, pose=Pose(0.0, 0.0, theta), seconds=20.0)
    turned = 0.0 if "relative_to" in use else theta
    x, y = expected
    there = (x * math.cos(turned) - y * math.sin(turned), x * math.sin(turned) + y * math.cos(turned))
    assert robot.status == "done"
    assert math.dist((robot.pose.x, robot.pose.y), there) < 0.3


def test_to_a_goal_and_its_final_heading() -> None:
    goal = {"name": "move_to_goal", "x_m": 1.0, "y_m": 0.5, "heading_deg": -90.0}
    robot = driven({"schemas": [goal]}, seconds=30.0)
    assert robot.status == "done"
    assert math.dist((robot.pose.x, robot.pose.y), (1.0, 0.5)) < 0.15
    assert robot.pose.theta == pytest.approx(-math.pi / 2, abs=0.1)


def test_a_goal_in_the_map_moves_smoothly_with_it_and_waits_while_its_place_is_unknown() -> None:
    goal = {"name": "move_to_goal", "x_m": 3.0, "y_m": 0.0, "frame": "map"}
    robot = MissionRobot(mission({"schemas": [goal]}), map_frame=Pose(0.0, 0.0, 0.0))
    robot.cycle()
    robot.map_frame = Pose(0.0, 1.0, 0.0)
    ways = [robot.cycle().state.drive_request for _ in range(5)]
    places = [way.progress.memories[0].y for way in ways]  # type: ignore[union-attr]
    assert places == pytest.approx([GOAL_SLEW_M_S * STEP_S * (i + 1) for i in range(5)], abs=1e-9)
    robot.map_frame = None
    robot.cycle()
    assert "does not know its place in the map" in robot.reason
    robot.map_frame = Pose(0.0, 1.0, 0.0)
    robot.drive(40.0)
    assert robot.status == "done"
    assert math.dist((robot.pose.x, robot.pose.y), (3.0, 1.0)) < 0.15


def test_a_goal_that_was_reached_stays_reached_while_the_robot_turns() -> None:
    goal = {"name": "move_to_goal", "x_m": 0.0, "y_m": 0.0, "heading_deg": 180.0}
    robot = MissionRobot(mission({"schemas": [goal]}))
    robot.cycle()
    moved(robot, 0.3, 0.0).drive(20.0)
    assert robot.status == "done"
    assert (robot.pose.x, robot.pose.y) == (0.3, 0.0)
