"""Tests of the progress bar: on a terminal it counts steps, elsewhere nothing is printed."""

from __future__ import annotations

import io

from rich.console import Console

from runtime.support.progress import progress


def shown(*, terminal: bool) -> str:
    file = io.StringIO()
    console = Console(file=file, width=80, force_terminal=terminal, color_system=None)
    with progress(console, "driving", 4) as step:
        for _ in range(3):
            step()
    return file.getvalue()


def test_steps_are_counted_on_a_terminal() -> None:
    assert "driving" in shown(terminal=True)
    assert "75%" in shown(terminal=True)


def test_nothing_is_printed_elsewhere() -> None:
    assert shown(terminal=False) == ""
