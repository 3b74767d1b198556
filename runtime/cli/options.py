"""Options that several commands share, and how they are parsed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

from cyclopts import Parameter, Token

Sets = Annotated[
    tuple[str, ...],
    Parameter(
        name="--set",
        negative="",
        show_default=False,
        allow_leading_hyphen=False,
        help="Override a setting, e.g. ring.firing=quadrants; may be repeated.",
    ),
]
JsonFile = Annotated[str | None, Parameter(name="--json", help="Write a summary to this file (JSON).")]
Force = Annotated[
    bool, Parameter(name="--force", negative="", show_default=False, help="Overwrite files that exist already.")
]
UnitsOption = Annotated[Literal["m", "ft"], Parameter(help="Units of the printed tables.")]
Flag = Parameter(negative="", show_default=False)
Several = Parameter(negative="", consume_multiple=True)
"""Allows `--option a b c` besides repeating the option."""
ConfigFile = Annotated[str | None, Parameter(help="Run file, or the name of a shipped one.")]
RobotFile = Annotated[str | None, Parameter(help="Robot file, or the name of a shipped one.")]
Connect = Annotated[
    str | None,
    Parameter(help="URL of the run, on another machine with its token; by default the newest run here."),
]
WorldFile = Annotated[str | None, Parameter(help="World file, or the name of a shipped one.")]
ModelFiles = Annotated[
    tuple[str, ...],
    Parameter(
        negative="",
        show_default=False,
        help="Object model to look for: file, or the name of a shipped one; may be repeated.",
    ),
]


def parse_whole_number(_type: type, tokens: Sequence[Token]) -> int:
    """Return a whole number ≥ 0; without this converter, cyclopts takes 1.5 for 1.

    Raises
    ------
    ValueError
        The text is not a whole number.
    """
    text = tokens[0].value
    if not (text.isascii() and text.isdigit()):
        raise ValueError(f"{text!r} must be a whole number, 0 or above.")
    return int(text)


def parse_port(_type: type, tokens: Sequence[Token]) -> int:
    """Return a TCP port, 0 for any that is free.

    Raises
    ------
    ValueError
        There is no such port.
    """
    port = parse_whole_number(_type, tokens)
    if port >= 1 << 16:
        raise ValueError(f"{port}: a TCP port is a whole number from 0 to 65535.")
    return port


Count = Annotated[int, Parameter(converter=parse_whole_number)]
TcpPort = Annotated[int, Parameter(converter=parse_port)]
