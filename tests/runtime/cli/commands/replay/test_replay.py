"""`echolocate replay`: what a user can get wrong before anything is replayed."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import FAILED, WRONG_CALL
from tests.runtime.cli.user_errors import Calls, assert_refused, call_name

pytestmark = pytest.mark.usefixtures("bad_files")

WRONG: Calls = [
    (["replay"], "LOG"),
    (["replay", "nowhere.csv"], "nowhere.csv"),
    (["replay", "."], "."),
    (["replay", "column.csv"], "'y'"),
    (["replay", "seven.csv"], "row 7 column 'r00' is 'one'"),
    (["replay", "sixteen.csv"], "16 sensor columns"),
    (["replay", "binary.csv"], "binary.csv"),
    (["replay", "regular"], "regular: is empty"),
    (["replay", "good.csv", "--model", "cat"], "cat"),
    (["replay", "good.csv", "--robot", "dening"], "dening"),
    (["replay", "good.csv", "--verify"], "apply to recordings (MCAP) only"),
    (["replay", "good.csv", "--from", "1"], "--from"),
]


@pytest.mark.parametrize(("arguments", "cause"), WRONG, ids=call_name)
def test_a_wrong_call(arguments: list[str], cause: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert_refused(arguments, cause, WRONG_CALL, capfd)


FAILING: Calls = [
    (["replay", "good.csv", "--json", "nowhere/x.json"], "nowhere/x.json"),
]


@pytest.mark.parametrize(("arguments", "cause"), FAILING, ids=call_name)
def test_work_that_failed(arguments: list[str], cause: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert_refused(arguments, cause, FAILED, capfd)
    assert Path("regular").read_bytes() == b""
