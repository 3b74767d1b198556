"""Tests of the stylesheet: every colour in use is defined, for light and for dark screens."""

from __future__ import annotations

import re

from runtime.analysis.report.inline_svg import VARIABLES
from runtime.analysis.report.stylesheet import CSS


def test_every_colour_has_a_light_and_a_dark_form() -> None:
    for variable in {*VARIABLES.values(), *re.findall(r"var\((--\w+)\)", CSS)}:
        assert CSS.count(f"{variable}:") == 2, variable
    assert CSS.count("prefers-color-scheme: dark") == 1


def test_braces_are_balanced() -> None:
    assert CSS.count("{") == CSS.count("}")
