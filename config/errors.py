"""The error base class for everything a user can cause, and the exit codes of every command.

A user error is shown as one clear line on stderr and an exit code, never as a traceback. It is defined here because
every package may import `config`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Final

DONE: Final = 0
FAILED: Final = 1
"""The work failed."""
WRONG_CALL: Final = 2
"""The call or the configuration was wrong."""
NOT_SHOWN: Final = 3
"""No fault was found, but a test could not show that all is good."""


class UserError(Exception):
    """An error that a user can cause: one line with what happened, the likely cause, and the next action.

    The command exits with `exit_code`, or with the class's own.
    """

    exit_code: int = FAILED
    is_of_file: bool = True
    """Whether it may be about what a file says; False for what the machine lacks."""

    def __init__(self, text: str, exit_code: int | None = None) -> None:
        super().__init__(text)
        if exit_code is not None:
            self.exit_code = exit_code


@contextlib.contextmanager
def naming_file(file: str | None) -> Iterator[None]:
    """Begin the message of an error with the file that it is about, unless that is None or the message names it."""
    try:
        yield
    except UserError as error:
        if file is not None and error.is_of_file and not str(error).startswith(f"{file}:"):
            error.args = (f"{file}: {error}",)
        raise
