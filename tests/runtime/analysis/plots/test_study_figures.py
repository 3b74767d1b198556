"""The figures of a study show what they are given."""

from __future__ import annotations

import numpy as np

from runtime.analysis.plots.study_figures import effects_figure, trade_off_figure


def test_a_trade_off_shows_all_the_front_and_the_best() -> None:
    points = [(1.0, 0.5), (2.0, 0.9), (3.0, 0.7)]
    figure = trade_off_figure(points, [points[1], points[0]], points[1], ("false", "recall"))
    (axes,) = figure.axes
    drawn = {str(line.get_gid()): line.get_xydata() for line in axes.lines}
    for name, expected in (("combinations", points), ("front", points[:2]), ("best", [points[1]])):
        np.testing.assert_array_equal(np.asarray(drawn[name]), expected)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("false", "recall")


def test_effects_have_a_row_for_each_value() -> None:
    figure = effects_figure([("a", [("1", 0.5), ("2", 0.75)]), ("b", [("on", 0.6), ("off", 0.65)])], "recall")
    (axes,) = figure.axes
    assert [text.get_text() for text in axes.get_yticklabels()] == ["a = 1", "a = 2", "b = on", "b = off"]
    np.testing.assert_array_equal([line.get_xdata() for line in axes.lines], [[0.5, 0.75], [0.6, 0.65]])
