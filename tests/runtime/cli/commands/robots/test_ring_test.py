"""`echolocate ring-test`: what a user can get wrong; the test itself is tested with `ring_trial`."""

from __future__ import annotations

import pytest

from config.errors import WRONG_CALL
from tests.runtime.cli.user_errors import Calls, assert_refused, call_name

pytestmark = pytest.mark.usefixtures("bad_files")

WRONG: Calls = [
    (["ring-test", "/dev/nowhere"], "/dev/nowhere"),
    (["ring-test", "/dev/nowhere", "--rounds", "0"], "--rounds"),
    (["ring-test", "/dev/null", "--rounds", "many"], "many"),
    (["ring-test", "/dev/null", "--robot", "nowhere.toml"], "nowhere.toml"),
]


@pytest.mark.parametrize(("arguments", "cause"), WRONG, ids=call_name)
def test_a_wrong_call(arguments: list[str], cause: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert_refused(arguments, cause, WRONG_CALL, capfd)
