"""Checks of what a user sees of a wrong call or of failed work: the exit code and one clear line, no traceback."""

from __future__ import annotations

import re
from collections.abc import Sequence

import pytest

from config.errors import WRONG_CALL
from runtime.cli.app import run_command

LOG_LINE = re.compile(r"^\S+Z \[(info|warning) *\] ")
"""Log output of a headless run before its error message."""

Calls = Sequence[tuple[list[str], str]]
"""Arguments of calls, and what the error message names."""


def error_lines(captured: str) -> list[str]:
    """Return the error messages on stderr: all lines that are not log lines."""
    assert "Traceback" not in captured
    lines = [line for line in captured.splitlines() if not LOG_LINE.match(line)]
    for line in lines:
        assert line.startswith("echolocate: "), line
        assert line.isprintable()
    return lines


def assert_refused(arguments: list[str], cause: str, code: int, capfd: pytest.CaptureFixture[str]) -> None:
    """Run a command that is to end with `code` and one line that names the cause."""
    assert run_command(arguments) == code
    captured = capfd.readouterr()
    (line,) = error_lines(captured.err)
    assert cause in line
    assert captured.out == "" or code != WRONG_CALL


def call_name(value: object) -> str:
    """Return the test ID of a call: its words."""
    return " ".join(value) if isinstance(value, list) else ""
