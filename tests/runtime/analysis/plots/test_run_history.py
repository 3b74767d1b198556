"""Tests of the history figure: objects known, their errors, and the time between cycles."""

from __future__ import annotations

import numpy as np
import pytest

from runtime.analysis.plots.run_history import history_figure
from tests.runtime.analysis.synthetic_timeline import ERROR_M, synthetic_timeline


def test_the_history_shows_objects_errors_and_gaps() -> None:
    figure = history_figure(synthetic_timeline(), "ft")
    known, errors, gaps = figure.axes
    lines = {line.get_gid(): np.asarray(line.get_ydata()) for panel in figure.axes for line in panel.lines}
    assert lines["known"].tolist() == [0, 1, 2, 3]
    assert lines["mean"] == pytest.approx([ERROR_M / 0.3048] * 3)
    assert lines["worst"] == pytest.approx(lines["mean"])
    assert lines["gaps"] == pytest.approx([50.0] * 59)
    lines_of_data = {"known", "mean", "worst", "gaps"}
    assert known.get_ylabel() == "objects known"
    assert errors.get_ylabel() == "error (ft)"
    assert gaps.get_xlabel() == "t (s)"
    marks = [
        str(line.get_gid()) for panel in figure.axes for line in panel.lines if line.get_gid() not in lines_of_data
    ]
    assert len(set(marks)) == len(marks) == len(figure.axes), "each panel has the bookmark, under an id of its own"
    assert all(mark.startswith("bookmark-1") for mark in marks)


def test_without_a_known_world_there_are_no_errors() -> None:
    figure = history_figure(synthetic_timeline(with_world=False), "m")
    assert [panel.get_ylabel() for panel in figure.axes] == ["objects known", "between cycles (ms)"]
