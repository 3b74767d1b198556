"""The text of a robot file: it loads as what it was written from."""

from __future__ import annotations

import pytest

from config.load import list_shipped, load_robot, parse_text
from config.robot import RobotConfig
from config.robot_file import robot_text


@pytest.mark.parametrize("name", list_shipped("robots"))
def test_a_robot_comes_back_from_its_text(name: str) -> None:
    robot = load_robot(name)
    text = robot_text(robot.model_dump(mode="json", exclude_none=True), ("A copy.",))
    assert text.startswith("# A copy.\n")
    assert parse_text(RobotConfig, text, "copy") == robot
    assert text.count("{ x_m = ") == len(robot.ring.sensors or ()), "a line a sensor"


def test_a_name_is_quoted_and_what_is_not_given_is_left_out() -> None:
    text = robot_text({"robot": {"name": 'a "b"\n[ring]\n', "driver": None}, "link": {"port": None}}, ())
    assert text == '\n[robot]\nname = "a \\"b\\"\\n[ring]\\n"\n'
