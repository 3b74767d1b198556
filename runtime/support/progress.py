"""The progress bar of every command that takes a while."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


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
    from rich.progress import Progress

    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=total)
        yield lambda: bar.update(task, advance=1)
