"""`echolocate ros2-robot`: the text of the file, and one line for what is missing."""

from __future__ import annotations

import tomllib

import pytest

from config.errors import FAILED, UserError
from config.robot import RobotConfig
from runtime.bridges.ros2.robot_file import Heard
from runtime.cli.app import run_command
from runtime.cli.commands.robots import ros2_robot
from runtime.cli.commands.robots.ros2_robot import robot_file_text
from tests.runtime.bridges.ros2.test_robot_file import heard


def test_the_text_is_a_robot_file() -> None:
    text = robot_file_text(heard(), 0.3, 0.4, 1.0)
    assert text.startswith("# A robot with ROS 2")
    assert RobotConfig.model_validate(tomllib.loads(text)).link.port == "ros2"


def test_what_is_missing_or_impossible_is_one_line() -> None:
    with pytest.raises(UserError, match="no sensor_msgs/Range"):
        robot_file_text(Heard(), 0.3, 0.4, 1.0)
    wide = heard()
    wide.ranges = dict.fromkeys(wide.ranges, (0.1, 4.0, 6.0))
    with pytest.raises(UserError, match=r"the robot's ring\.beam_half_angle_deg: ") as caught:
        robot_file_text(wide, 0.3, 0.4, 1.0)
    assert "\n" not in str(caught.value)


def test_without_ros_it_says_how_to_install_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: object
) -> None:
    monkeypatch.setattr(ros2_robot, "find_spec", lambda _: None)
    assert run_command(["ros2-robot", "--radius", "0.3", "--out", f"{tmp_path}/x.toml"]) == FAILED
    assert "pip install" in capsys.readouterr().err
