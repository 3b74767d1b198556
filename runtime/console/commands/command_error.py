"""The exception of a console command that was not carried out, with the reason as text for the operator."""

from __future__ import annotations

from config.errors import UserError


class CommandError(UserError):
    """A command was not carried out; the client gets the text in its answer, and the connection stays open.

    The text says what is wrong and what to do; `field` is the input field of the page next to which it belongs.
    """

    def __init__(self, text: str, field: str | None = None) -> None:
        super().__init__(text)
        self.field = field
