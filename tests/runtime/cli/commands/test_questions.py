"""Questions: options first, then answers, which are kept when all together are refused."""

from __future__ import annotations

import io

import pytest

from config.errors import UserError
from runtime.cli.commands.questions import Questions


def test_an_answer_is_the_default_of_the_next_round_and_an_option_is_not_asked_for(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ask = Questions({"depth": 3.0, "flag": True}, asks=True)
    monkeypatch.setattr("sys.stdin", io.StringIO("2.5\n\n"))
    assert (ask.number("width", "Width, m", 1.0, 0.0, 9.0), ask.number("depth", "Depth, m", 1.0, 0.0, 9.0)) == (
        2.5,
        3.0,
    )
    ask.again("too wide")
    assert ask.number("width", "Width, m", 1.0, 0.0, 9.0) == 2.5
    assert ask.is_given("flag")
    assert "too wide\nOnce more: Enter keeps an answer.\nWidth, m [2.5]: " in capsys.readouterr().err


def test_an_option_that_only_an_earlier_round_asked_for_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    ask = Questions({"spacing": 30.0}, asks=True)
    monkeypatch.setattr("sys.stdin", io.StringIO("in-front\nall-round\n"))
    for layout in ("in-front", "all-round"):
        assert ask.choice("layout", "Layout", ("in-front", "all-round")) == layout
        if layout == "in-front":
            ask.number("spacing", "Spacing", 1.0, 0.0, 90.0)
            ask.refuse_unused("--layout")
            ask.again("too far apart")
    with pytest.raises(UserError, match="--spacing: no meaning"):
        ask.refuse_unused("--layout")
    ask.refuse_unused("--layout", ("spacing",))


def test_what_the_options_alone_say_is_refused_once() -> None:
    with pytest.raises(UserError, match="too wide"):
        Questions({"width": 3.0}, asks=True).again("too wide")
