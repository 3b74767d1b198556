"""`echolocate fleet` as a command: it says where its page is, and a wrong call is one line."""

from __future__ import annotations

import pytest

from config.errors import WRONG_CALL
from runtime.cli.app import run_command


def test_a_wrong_address_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["fleet", "http://host/"]) == WRONG_CALL
    error = capsys.readouterr().err
    assert error.startswith("echolocate: http://host/: give the start URL")
    assert len(error.splitlines()) == 1
