"""Restart of this program in place: same command, same process number, and the open pages come back by themselves."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from typing import Final, NamedTuple, NoReturn

VARIABLE: Final = "ECHOLOCATE_RESTART"
"""Hands port and token of the console over to the program after a restart."""


class ConsoleBefore(NamedTuple):
    """Where the console was before a restart."""

    port: int
    token: str


def is_restart() -> bool:
    """Return whether this program was started again by itself; no longer once `console_before` was asked."""
    return VARIABLE in os.environ


def console_before() -> ConsoleBefore | None:
    """Return where the console was before a restart, once; None if this is a start."""
    port, _, token = os.environ.pop(VARIABLE, "").partition(" ")
    return ConsoleBefore(int(port), token) if port.isdecimal() and int(port) < 1 << 16 and token else None


def restart_refusal(own_files: Mapping[str, str | None], *, force: bool, was_chosen: bool) -> str | None:
    """Return why the command line of a run could not be carried out again, None if it could.

    Parameters
    ----------
    own_files : mapping
        By option, the file that the run writes, None for no file.
    force : bool
        Whether it may overwrite them.
    was_chosen : bool
        Whether the port was chosen in the terminal, and not by the command line.
    """
    if was_chosen:
        return "the port of this run was chosen in its terminal: start it again there, or with --port"
    given = [option for option, path in own_files.items() if path is not None]
    if given and not force:
        return f"{given[0]} names a file that this run has written: start the run again with --force"
    return None


class Restart:
    """Whether this program is to be started again when it has ended in order.

    Parameters
    ----------
    refusal : str, optional
        Why its command line cannot be carried out twice; None if it can.
    """

    def __init__(self, refusal: str | None) -> None:
        self.refusal = refusal
        self._console: ConsoleBefore | None = None

    def request(self, console: ConsoleBefore) -> None:
        """Start the program again, with the console as it is, once the run has ended."""
        self._console = console

    def if_requested(self) -> None:
        """Start the program again now, if that was requested; then this does not return."""
        if self._console is not None:
            _restart(self._console)


def _restart(console: ConsoleBefore) -> NoReturn:
    """Replace this program with a new one of the same command line, except that it arms no robot."""
    sys.stdout.flush()
    sys.stderr.flush()
    os.environ[VARIABLE] = f"{console.port} {console.token}"
    words = [word for word in sys.orig_argv[1:] if word.partition("=")[0] != "--arm"]
    os.execv(sys.executable, [sys.executable, *words])  # noqa: S606 - this very program
