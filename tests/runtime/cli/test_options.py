"""Tests of the options that several commands share: whole numbers are exact, and lists take several values."""

from __future__ import annotations

import pytest
from cyclopts import Token

from config.errors import DONE, WRONG_CALL
from runtime.cli.app import run_command
from runtime.cli.options import parse_whole_number


def parsed(text: str) -> int:
    return parse_whole_number(int, [Token(value=text)])


def test_whole_numbers() -> None:
    assert [parsed(text) for text in ("0", "7", "0123", "4294967296")] == [0, 7, 123, 2**32]


@pytest.mark.parametrize("text", ["1.5", "-1", "", " 1", "1e3", "0x10", "²", "٣"])
def test_what_is_not_a_whole_number_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="must be a whole number"):
        parsed(text)


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["--set", "cycle.rate_hz=10", "--set", "log.level=warning"], DONE),
        (["--set", "cycle.rate_hz=10", "log.level=warning"], WRONG_CALL),
        (["--set", "--arm"], WRONG_CALL),
        (["--no-set", "cycle.rate_hz=10"], WRONG_CALL),
    ],
)
def test_a_setting_needs_an_option_each(words: list[str], code: int, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["check", "hallway", *words]) == code
    capsys.readouterr()
