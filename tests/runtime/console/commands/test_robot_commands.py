"""Robot files from the page: what `check` accepts, and nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from config.errors import DONE
from config.load import load_robot
from runtime.cli.app import run_command
from tests.runtime.console.console_case import open_console
from tests.runtime.console.sample_messages import ROBOT

SENSORS = [[0.1, 0.001 * angle, float(angle)] for angle in range(-75, 76, 15)]


@pytest.mark.parametrize("changes", [
    {}, {"name": ""}, {"count": 24, "preset": "octets", "synchro": True},
    {"count": None, "radius_m": None, "sensors": SENSORS, "preset": "single", "range_max_m": 3.0},
])  # fmt: skip
async def test_the_file_of_a_robot_is_one_that_check_accepts(changes: dict[str, Any], tmp_path: Path) -> None:
    asked = ROBOT | changes
    async with open_console() as case:
        page = await case.page()
        answer = await page.ask(**asked)
    assert answer["ok"], answer["error"]
    path = tmp_path / "robot.toml"
    path.write_text(answer["data"], "utf-8")
    robot = load_robot(path)
    assert len(robot.ring.mounts) == (asked["count"] or len(SENSORS))
    assert (robot.robot.name, robot.body.synchro) == (asked["name"] or None, asked["synchro"])
    assert robot.ring.firing.preset == asked["preset"]
    assert run_command(["check", str(path)]) == DONE


@pytest.mark.parametrize(("changes", "error"), [
    ({"count": 0}, "ring.count"), ({"radius_m": -1.0}, "ring.radius_m"), ({"range_min_m": 5.0}, "range_max_m"),
    ({"preset": "all"}, "preset"), ({"driver": "none"}, "none"), ({"sensors": []}, "sensors"),
    ({"count": 10, "preset": "octets"}, ""), ({"step_period_s": 0.005}, "step_period_s"),
    ({"body_radius_m": 0.0}, "body.radius_m"),
])  # fmt: skip
async def test_a_robot_that_cannot_be_is_refused_with_the_reason(changes: dict[str, Any], error: str) -> None:
    async with open_console() as case:
        page = await case.page()
        answer = await page.ask(**(ROBOT | changes))
        assert not answer["ok"]
        assert error in answer["error"], answer["error"]
