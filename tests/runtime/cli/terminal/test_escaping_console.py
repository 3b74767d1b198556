"""Whatever a command prints, no text of others acts on the terminal."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from rich.console import Group
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from runtime.cli import commands
from runtime.cli.terminal.escaping_console import EscapingConsole, escaped

HOSTILE = (
    "\x1b[2J",
    "\x9b1A",
    "\x1b]0;title\x07",
    "a\rb",
    "\u202egnp.exe",
    "\x7f",
    "\udcff",
    "a[/b]",
    "[red]",
    ":bomb:",
)


def as_table(text: str) -> Table:
    table = Table(text, title=text)
    table.add_row(text, style="bold")
    return table


@pytest.mark.promise("P22")
@pytest.mark.parametrize("form", [str, Text, as_table, lambda text: Panel(Group(Text(text), text))])
def test_no_text_acts_on_the_terminal(form: Callable[[str], str | Text | Table | Panel]) -> None:
    for text in HOSTILE:
        shown = io.StringIO()
        EscapingConsole(shown, soft_wrap=True).print(form(text))
        assert all(line.isprintable() for line in shown.getvalue().split("\n")), text
        if form is str:
            assert shown.getvalue() == f"{escaped(text)}\n", "nothing is left out"


def test_styles_and_lines_of_our_own_pass() -> None:
    shown = io.StringIO()
    console = EscapingConsole(shown)
    console.print("two\nlines")
    assert shown.getvalue() == "two\nlines\n"
    assert escaped("ö → ½\n") == "ö → ½\n"


def test_every_command_prints_on_such_a_console() -> None:
    for path in Path(str(commands.__file__)).parent.glob("*.py"):
        if path.name != "serve_console.py":  # the operator's
            assert not re.search(r"(?<!Escaping)\bConsole\(", path.read_text("utf-8")), path


def output(monkeypatch: pytest.MonkeyPatch, width: int, *, is_terminal: bool) -> io.StringIO:
    out = io.StringIO()
    monkeypatch.setattr(out, "isatty", lambda: is_terminal)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", str(width))
    return out


@pytest.mark.parametrize("width", [20, 40, 80])
@pytest.mark.parametrize("is_terminal", [True, False])
def test_no_number_of_a_table_is_cut(monkeypatch: pytest.MonkeyPatch, width: int, *, is_terminal: bool) -> None:
    out = output(monkeypatch, width, is_terminal=is_terminal)
    table = Table(title="figures")
    for heading in ("between cycles: what", "median (ms)", "p99 (ms)", "p99.9 (ms)"):
        table.add_column(heading)
    table.add_row("line opened", "1234.567", "2345.678", "3456.789")
    EscapingConsole(out).print(table)
    shown = out.getvalue()
    assert "…" not in shown
    assert all(number in shown for number in ("1234.567", "2345.678", "3456.789"))
    assert is_terminal or "between cycles: what" in shown


@pytest.mark.parametrize("width", [20, 40, 80])
@pytest.mark.parametrize("is_terminal", [True, False])
def test_no_column_is_left_out(monkeypatch: pytest.MonkeyPatch, width: int, *, is_terminal: bool) -> None:
    """Where no column may wrap, rich takes the whole width of one away."""
    out = output(monkeypatch, width, is_terminal=is_terminal)
    table = Table()
    for k in range(12):
        table.add_column(f"heading {k}\nm", no_wrap=True)
    table.add_row(*(f"{k}.25 m" for k in range(12)))
    EscapingConsole(out).print(table)
    assert re.findall(r"heading (\d+)", out.getvalue()) == [f"{k}" for k in range(12)]
    assert re.findall(r"(\d+)\.25 m", out.getvalue()) == [f"{k}" for k in range(12)]


def test_on_a_narrow_terminal_a_table_has_no_lines_rather_than_wraps(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: dict[int, list[str]] = {}
    for width in (40, 80):
        out = output(monkeypatch, width, is_terminal=True)
        table = Table("what", "median", "p99", "p99.9", "worst")
        table.add_row("lateness of a cycle's start", "0.29", "3.38", "1283.97", "1971.62")
        EscapingConsole(out).print(table)
        shown[width] = re.sub(r"\x1b\[[0-9;]*m", "", out.getvalue()).splitlines()
        assert max(map(len, shown[width])) <= width
    assert "┃" in "".join(shown[80])
    assert "┃" not in "".join(shown[40])
