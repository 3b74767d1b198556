"""Tests of the style of figures: matplotlib knows every setting, and colours differ."""

from __future__ import annotations

import itertools
from typing import Any

import matplotlib as mpl
import pytest
from matplotlib.colors import to_rgb

from runtime.analysis.plots.plot_style import CLUSTER, ECHO, GRID, INK, MUTED, PAPER, RC, ROBOT, SEGMENT, TRUTH


def luminance(colour: str) -> float:
    """Return the relative luminance of WCAG 2."""
    linear = [v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in to_rgb(colour)]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def test_matplotlib_knows_every_setting() -> None:
    settings: Any = dict(RC)
    with mpl.rc_context(settings):
        assert mpl.rcParams["svg.hashsalt"] == "echolocate"
        assert mpl.rcParams["axes.facecolor"] == PAPER


def test_no_two_colours_are_the_same() -> None:
    colours = (INK, MUTED, GRID, PAPER, TRUTH, ECHO, SEGMENT, CLUSTER, ROBOT)
    for one, other in itertools.combinations(colours, 2):
        assert sum(abs(a - b) for a, b in zip(to_rgb(one), to_rgb(other), strict=True)) > 0.1, (one, other)


@pytest.mark.parametrize(("colour", "contrast"), [(INK, 7.0), (MUTED, 4.5), (SEGMENT, 3.0), (ECHO, 3.0)])
def test_text_and_lines_stand_out_from_paper(colour: str, contrast: float) -> None:
    """WCAG 2 asks for 4.5 for text and for 3 for graphics."""
    assert (luminance(PAPER) + 0.05) / (luminance(colour) + 0.05) >= contrast
