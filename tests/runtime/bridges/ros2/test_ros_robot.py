"""A robot made only of ROS topics is driven by a run, which finds the six drums: `make ros2`."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from config.load import load_world

pytestmark = [
    pytest.mark.soak,
    pytest.mark.ros2,
    pytest.mark.realtime,
    pytest.mark.filterwarnings("default::DeprecationWarning"),  # of ROS's own packages
]
SECONDS = 60


def test_a_robot_made_of_topics_finds_six_drums(tmp_path: Path, measured: Callable[[str], None]) -> None:
    from tests.runtime.bridges.ros2.ros_case import START_MAX_S, program

    flag = tmp_path / "ready"
    with program(tmp_path, str(flag), module="tests.runtime.bridges.ros2.emulated_robot"):
        end_s = time.monotonic() + START_MAX_S
        while not flag.exists():
            assert time.monotonic() < end_s
            time.sleep(0.1)
        robot, summary = tmp_path / "robot.toml", tmp_path / "summary.json"
        with program(tmp_path, "ros2-robot", "--out", str(robot), "--radius", "0.3", "--speed", "0.3") as writing:
            assert writing.wait(START_MAX_S) == 0, (tmp_path / "ros2-robot.log").read_text()
        with program(
            tmp_path, "run", "--robot", str(robot), "--headless", "--no-record", "--no-console", "--arm", "--seconds",
            str(SECONDS), "--json", str(summary),
        ) as run:  # fmt: skip
            assert run.wait(SECONDS + START_MAX_S) == 0, (tmp_path / "run.log").read_text()
    world, found = load_world("hallway"), json.loads(summary.read_text())
    start = world.start
    seen = [(o["x"] + start.x_m, o["y"] + start.y_m) for o in found["objects"]]
    errors_m = [min(math.dist(place, (drum.x_m, drum.y_m)) for place in seen) for drum in world.drum]
    assert max(errors_m) < 0.03
    assert len(seen) == 6
    measured(f"6 of 6 drums, 0 false, worst {max(errors_m):.4f} m; late cycles {found['late']} of {found['cycles']}")
