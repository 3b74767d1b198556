"""What becomes of a message that is not done: one exception, whose text is for the operator."""

from __future__ import annotations

from config.errors import UserError


class Refusal(UserError):  # noqa: N818 - it is said to a person
    """Why something is not done.

    Parameters
    ----------
    text : str
        For the operator.
    field : str, optional
        Beside which field of the page it belongs.
    """

    def __init__(self, text: str, field: str | None = None) -> None:
        super().__init__(text)
        self.field = field
