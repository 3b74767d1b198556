"""Tests of the commands `firmware` and `ring-test`: what a user can get wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import FAILED, WRONG_CALL
from tests.runtime.cli.user_errors import Calls, assert_refused, call_name

pytestmark = pytest.mark.usefixtures("bad_files")

WRONG: Calls = [
    (["firmware"], "--board"),
    (["firmware", "--board", "uno", "--out", "x"], "uno"),
    (["firmware", "--board", "pico"], "--out"),
    (["ring-test", "/dev/nowhere"], "/dev/nowhere"),
    (["ring-test", "/dev/null", "--rounds", "many"], "many"),
    (["ring-test", "/dev/null", "--robot", "nowhere.toml"], "nowhere.toml"),
]


@pytest.mark.parametrize(("arguments", "cause"), WRONG, ids=call_name)
def test_a_wrong_call(arguments: list[str], cause: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert_refused(arguments, cause, WRONG_CALL, capfd)


def test_a_folder_that_is_a_file(capfd: pytest.CaptureFixture[str]) -> None:
    assert_refused(["firmware", "--board", "pico", "--out", "regular"], "regular", FAILED, capfd)
    assert Path("regular").read_bytes() == b""
