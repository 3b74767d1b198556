"""Tests of the commands `ros2`, `ros2-robot` and `foxglove`: what a user can get wrong before ROS is needed."""

from __future__ import annotations

import pytest

from config.errors import WRONG_CALL
from tests.runtime.cli.user_errors import Calls, assert_refused, call_name

pytestmark = pytest.mark.usefixtures("bad_files")

WRONG: Calls = [
    (["ros2", "--connect"], "--connect"),
    (["ros2-robot", "--out", "x.toml"], "--radius"),
    (["foxglove", "--port", "many"], "many"),
    (["ros2-robot", "--radius", "0.3"], "--out"),
    (["ros2-robot", "--radius", "0", "--out", "x.toml"], "--radius"),
]


@pytest.mark.parametrize(("arguments", "cause"), WRONG, ids=call_name)
def test_a_wrong_call(arguments: list[str], cause: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert_refused(arguments, cause, WRONG_CALL, capfd)
