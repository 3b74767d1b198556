"""Tests of lengths as text, in metres and in feet."""

from __future__ import annotations

import pytest

from runtime.support.length_format import Units, format_length, format_point


@pytest.mark.parametrize(
    ("metres", "units", "digits", "text"),
    [(0.3048, "ft", 2, "1.00"), (0.3048, "m", 2, "0.30"), (-1.0, "m", 3, "-1.000"), (-0.06096, "ft", 3, "-0.200")],
)
def test_lengths_in_both_units(metres: float, units: Units, digits: int, text: str) -> None:
    assert format_length(metres, units, digits) == text


def test_a_point() -> None:
    assert format_point(0.3048, -1.2192, "ft") == "(1.00, -4.00)"
    assert format_point(0.3048, -1.2192, "m") == "(0.30, -1.22)"
