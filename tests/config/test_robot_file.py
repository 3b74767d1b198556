"""The text of a robot file: it loads as what it was written from."""

from __future__ import annotations

from dataclasses import replace

import pytest

from config.load import parse_text
from config.robot import RobotConfig
from config.robot_file import ARCOS_BAUD, BAUD, RobotDraft, robot_text

DRAFT = RobotDraft(
    "Ella", "denning", 16, 0.2, None, 12.0, 0.01, 0.1, 4.0, "quadrants", 0.05, 0.22, 0.5, 1.5, synchro=False
)
SENSORS = ((0.1, 0.0, 0.0), (0.08, -0.06, -30.5))


@pytest.mark.parametrize("driver", ["denning", "arcos", "rflex", "ros2"])
def test_a_robot_comes_back_from_its_text(driver: str) -> None:
    robot = parse_text(RobotConfig, robot_text(replace(DRAFT, driver=driver)), "draft")
    assert (robot.robot.name, robot.robot.driver, robot.ring.count, robot.ring.radius_m) == ("Ella", driver, 16, 0.2)
    assert (robot.ring.range_max_m, robot.ring.firing.preset, robot.body.synchro) == (4.0, "quadrants", False)
    assert robot.link.baud == (ARCOS_BAUD if driver == "arcos" else BAUD)


def test_sensors_one_by_one_and_a_line_of_ones_own() -> None:
    draft = replace(DRAFT, sensors=SENSORS, count=None, radius_m=None, baud=9600, port="/dev/ttyUSB0")
    robot = parse_text(RobotConfig, robot_text(draft), "draft")
    assert [(s.x_m, s.y_m, s.angle_deg) for s in robot.ring.sensors or ()] == list(SENSORS)
    assert (robot.link.baud, robot.link.port) == (9600, "/dev/ttyUSB0")


def test_a_name_is_quoted_and_none_is_left_out() -> None:
    name = 'a "b"\n[ring] é'
    assert parse_text(RobotConfig, robot_text(replace(DRAFT, name=name)), "draft").robot.name == name
    assert parse_text(RobotConfig, robot_text(replace(DRAFT, name="")), "draft").robot.name is None
