"""Lengths as text, in metres or in feet: shared by tables, figures, the report page and the console."""

from __future__ import annotations

from typing import Literal, TypeAlias

from config.units import FOOT_M

Units: TypeAlias = Literal["m", "ft"]
"""The unit of length that a user asks for."""


def format_length(metres: float, units: Units, digits: int = 2) -> str:
    """Return a length as text.

    Parameters
    ----------
    metres : float
        The length, m.
    units : {"m", "ft"}
        The unit of the text, which does not name it.
    digits : int
        Decimals.
    """
    return f"{metres if units == 'm' else metres / FOOT_M:.{digits}f}"


def format_point(x: float, y: float, units: Units) -> str:
    """Return the point (x, y), given in metres, as text in parentheses, as the paper's Table 2 prints it.

    Parameters
    ----------
    x, y : float
        The point, m.
    units : {"m", "ft"}
        The unit of the text, which does not name it.
    """
    return f"({format_length(x, units)}, {format_length(y, units)})"
