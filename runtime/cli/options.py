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
Several = Parameter(negative="", consume_multiple=True)
"""`--option a b c`, as well as the option again and again."""
ConfigFile = Annotated[str | None, Parameter(help="Run file, or the name of a shipped one.")]
RobotFile = Annotated[str | None, Parameter(help="Robot file, or the name of a shipped one.")]
ModelFiles = Annotated[
    tuple[str, ...],
    Parameter(negative="", help="Object model to look for: a file or a name; may be repeated."),
]


def whole(_type: type, tokens: Sequence[Token]) -> int:
    """Return a whole number, none below zero; left alone, cyclopts takes 1.5 for 1."""
    text = tokens[0].value
    if not (text.isascii() and text.isdigit()):
        raise ValueError(f"{text!r} must be a whole number, 0 or above.")
    return int(text)


Seed = Annotated[int, Parameter(converter=whole)]
