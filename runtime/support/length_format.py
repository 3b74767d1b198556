"""Lengths as text, in metres or in feet: shared by tables, figures, the report page and the console."""

from __future__ import annotations

from typing import Literal, TypeAlias

from config.units import FOOT_M

Units: TypeAlias = Literal["m", "ft"]
"""The unit of length that a user asks for."""


def format_length(metres: float, units: Units, digits: int = 2) -> str:
    """Return a length, given in metres, as text with so many decimals in a unit that the text does not name."""
    return f"{metres if units == 'm' else metres / FOOT_M:.{digits}f}"


def format_point(x: float, y: float, units: Units) -> str:
    """Return the point (x, y), given in metres, as text in parentheses, as the paper's Table 2 prints it.

    The text does not name the unit.
    """
    return f"({format_length(x, units)}, {format_length(y, units)})"
