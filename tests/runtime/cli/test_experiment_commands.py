"""Tests of the command `experiment`: what a user can get wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import FAILED, WRONG_CALL
from tests.runtime.cli.user_errors import Calls, assert_refused, call_name

pytestmark = pytest.mark.usefixtures("bad_files")

WRONG: Calls = [
    (["experiment", "hallway", "--seeds", "1.5"], "1.5"),
    (["experiment"], "NAME"),
    (["experiment", "corridor"], "corridor"),
    (["experiment", "hallway", "--method", "psychic"], "psychic"),
    (["experiment", "hallway", "--seeds", "0"], "--seeds 0"),
    (["experiment", "hallway", "--seeds", "many"], "many"),
    (["experiment", "hallway", "--world", "empty.toml"], "drum"),
    (["experiment", "hallway", "--json"], "--json"),
    (["experiment", "irregular", "--scene", "clean"], "--scene"),
    (["experiment", "hallway", "--scene", "clean", "--world", "hallway"], "--scene"),
    (["experiment", "hallway", "--scene", "clean", "--out", "x"], "nothing to record"),
    (["experiment", "budget", "--scene", "clean"], "a hall of its own"),
    (["experiment", "budget", "--world", "hallway"], "a hall of its own"),
    (["experiment", "budget", "--seeds", "0"], "--seeds 0"),
]


@pytest.mark.parametrize(("arguments", "cause"), WRONG, ids=call_name)
def test_a_wrong_call(arguments: list[str], cause: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert_refused(arguments, cause, WRONG_CALL, capfd)


FAILING: Calls = [
    (["experiment", "hallway", "--method", "paper", "--json", "nowhere/x.json"], "nowhere/x.json"),
]


@pytest.mark.parametrize(("arguments", "cause"), FAILING, ids=call_name)
def test_work_that_failed(arguments: list[str], cause: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert_refused(arguments, cause, FAILED, capfd)
    assert Path("regular").read_bytes() == b""
