"""The progress of every command that takes a while: a bar on a terminal, lines for a program that asks for them."""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from rich.console import Console

PROGRESS_LINES: Final = "ECHOLOCATE_PROGRESS"
"""Environment variable; if it is set, progress goes to standard error as lines of `MARK`, share and name."""
MARK: Final = "progress "
LINES_PERIOD_S: Final = 0.25
"""Shortest time between two lines."""


@contextlib.contextmanager
def progress(console: Console, what: str, total: int | None = None) -> Iterator[Callable[[], None]]:
    """Show a progress bar on a terminal while the block runs; yield the function to call after each step.

    Parameters
    ----------
    console : Console
        Where it is shown, if that is a terminal.
    what : str
        What is being done.
    total : int, optional
        Number of steps, where it is known.
    """
    if os.environ.get(PROGRESS_LINES):
        yield _lines(what, total)
        return
    from rich.progress import Progress

    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=total)
        yield lambda: bar.update(task, advance=1)


def _lines(what: str, total: int | None) -> Callable[[], None]:
    """Return the function to call after each step, which writes a line now and then."""
    done, next_host_s = 0, 0.0

    def step() -> None:
        nonlocal done, next_host_s
        done += 1
        host_s = time.monotonic()
        if host_s >= next_host_s:
            next_host_s = host_s + LINES_PERIOD_S
            share = min(1.0, done / total) if total else 0.0
            sys.stderr.write(f"{MARK}{share:.3f} {what}\n")
            sys.stderr.flush()

    step()
    return step
