"""Draw the live view: `python -m runtime.cli.terminal` shows on standard output what standard input asks for.

Standard input takes pickles: a `Scale` first, then a `Snapshot` for each picture, and text for a line above it. In
the background no picture is drawn, and a line erases nothing: the terminal shows what the shell's commands print.
"""

from __future__ import annotations

import contextlib
import pickle
import signal
import sys
from collections.abc import Iterator

from rich.live import Live

from runtime.cli.terminal.escaping_console import EscapingConsole
from runtime.cli.terminal.foreground import in_foreground
from runtime.cli.terminal.picture import Picture, Scale, Snapshot


def received() -> Iterator[Scale | Snapshot | str]:
    """Yield what the parent process sends, until it closes the pipe or ends."""
    with contextlib.suppress(EOFError, pickle.UnpicklingError):  # it may end within a message
        while True:
            yield pickle.load(sys.stdin.buffer)  # noqa: S301 - from the parent process only


def main() -> None:
    """Draw until standard input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the parent process, too, which ends this one
    console, plain, picture = EscapingConsole(), EscapingConsole(sys.stdout), None
    with Live(console=console, auto_refresh=False, screen=False) as live:
        for message in received():
            if isinstance(message, Scale):
                picture = Picture(console, message)
            elif isinstance(message, Snapshot) and picture is not None and in_foreground(sys.stdout.fileno()):
                live.update(picture.draw(message), refresh=True)
            elif isinstance(message, str):
                shown = live.console if in_foreground(sys.stdout.fileno()) else plain
                shown.print(message, markup=False, highlight=False, soft_wrap=True)


if __name__ == "__main__":
    main()
