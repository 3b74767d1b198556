"""Options that several commands have, and how they are read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

from cyclopts import Parameter, Token

Sets = Annotated[
    tuple[str, ...],
    Parameter(
        name="--set",
        negative="",
        allow_leading_hyphen=False,
        help="Override one setting, as in ring.firing=quadrants.",
    ),
]
JsonFile = Annotated[str | None, Parameter(name="--json", help="Write the summary to this file.")]
UnitsOption = Annotated[Literal["m", "ft"], Parameter(help="Units of what is printed.")]
Flag = Parameter(negative="")


def whole(_type: type, tokens: Sequence[Token]) -> int:
    """Return a whole number, none below zero; left alone, cyclopts takes 1.5 for 1."""
    text = tokens[0].value
    if not (text.isascii() and text.isdigit()):
        raise ValueError(f"{text!r} must be a whole number, 0 or above.")
    return int(text)


Seed = Annotated[int, Parameter(converter=whole)]
