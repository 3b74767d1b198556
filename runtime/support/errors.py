"""Everything a user can cause ends here: one clear line and an exit code, never a traceback."""

from __future__ import annotations

from typing import Final

DONE: Final = 0
FAILED: Final = 1
"""The work failed."""
WRONG_CALL: Final = 2
"""The call or the configuration was wrong."""


class UserError(Exception):
    """What happened, the likely cause, and the next action, in one line.

    Parameters
    ----------
    text : str
        The line.
    exit_code : int
        What the command exits with.
    """

    def __init__(self, text: str, exit_code: int) -> None:
        super().__init__(text)
        self.exit_code = exit_code
