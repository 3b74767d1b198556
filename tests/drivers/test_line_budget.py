"""A line too slow for its traffic is refused where the robot is described, with what would do, for every family."""

from __future__ import annotations

import pytest

from config.load import load_robot
from config.robot import RobotConfig
from drivers.firing_pattern import FiringError
from drivers.registry import make_driver
from runtime.cli.app import run_command


def at(name: str, baud: int, port: str | None = None) -> RobotConfig:
    config = load_robot(name)
    return config.model_copy(update={"link": config.link.model_copy(update={"baud": baud, "port": port})})


@pytest.mark.parametrize(
    ("name", "too_slow", "enough"),
    [("p3dx", 4800, 9600), ("powerbot", 4800, 9600), ("b21r-both", 19200, 38400), ("magellan", 19200, 38400)],
)
def test_a_line_too_slow_for_its_traffic_is_refused(name: str, too_slow: int, enough: int) -> None:
    make_driver(at(name, enough))
    with pytest.raises(FiringError, match=rf"a line of {too_slow} baud carries .*set link.baud to {enough} or more"):
        make_driver(at(name, too_slow))
    make_driver(at(name, too_slow, "socket://robot:7000"))


def test_check_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["check", "hallway", "--set", "robot=magellan", "--set", "link.baud=9600"]) != 0
    assert "set link.baud to 38400 or more" in capsys.readouterr().err
