"""Tests of the four figures of a run: their names and numbers, and what each of them shows."""

from __future__ import annotations

import re

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.text import Text

from config.load import load_world
from drivers.messages import Pose
from runtime.analysis.plots.figure_files import styled, svg_of
from runtime.analysis.plots.paper_figures import HEIGHT_MAX_IN, HEIGHT_MIN_IN, Canvas, paper_figures, pictures
from runtime.analysis.plots.plot_style import WIDTH_IN
from tests.runtime.analysis.synthetic_timeline import synthetic_timeline, with_cross_paths, with_grid, with_known_way

RUN = synthetic_timeline()


def gids(figure: Figure) -> set[str]:
    return {gid for artist in figure.axes[0].get_children() if (gid := artist.get_gid()) is not None}


def test_each_figure_shows_its_own() -> None:
    shown = {name: gids(figure) for name, figure in pictures(RUN, "ft").items()}
    assert list(shown) == ["raw", "segments", "clusters", "models"]
    everywhere = {"truth", "path", "robot", "heading", "bookmark-1"}
    assert shown["raw"] == {*everywhere, "echoes"}
    assert shown["segments"] == {*everywhere, "segments"}
    boxes = {name for name in shown["clusters"] if re.fullmatch(r"cluster-\d+", name)}
    assert len(boxes) == 3
    assert shown["clusters"] == {*everywhere, "segments", *boxes, *(f"{name}-centre" for name in boxes)}
    seen = {name for name in shown["models"] if re.fullmatch(r"model-\d+", name)}
    assert len(seen) == 3
    assert shown["models"] >= {name.replace("model", "centre") for name in seen}
    assert "cluster-1" not in shown["models"]


def test_cross_paths_are_drawn_with_the_echoes() -> None:
    raw = pictures(with_cross_paths(synthetic_timeline()), "m")["raw"]
    assert "cross-paths" in gids(raw)
    assert any("2 cross paths" in text.get_text() for text in raw.findobj(Text))


def test_the_evidence_grid_lies_in_the_figure_where_it_lay() -> None:
    run = with_grid(synthetic_timeline())
    drawn = pictures(run, "ft")
    assert list(drawn) == ["raw", "segments", "clusters", "models", "grid"]
    (axes,) = drawn["grid"].axes
    (image,) = axes.get_images()
    assert image.get_gid() == "evidence-grid"
    corners = (image.get_transform() - axes.transData).transform([[0.0, 0.0], [1.0, 1.0]])
    ends = Canvas(run, "ft").frame.points(np.array([[1.0, -0.5], [1.3, -0.3]]))
    assert np.allclose(corners, ends)
    shades = np.asarray(image.get_array())[..., 3]
    assert shades.tolist() == pytest.approx(np.array([[0.0, 0.8, 0.8], [0.0, 0.0, 1.0]]))
    assert "data:image/png" in svg_of(drawn["grid"])


def test_a_corrected_path_has_a_figure() -> None:
    run = with_known_way(synthetic_timeline())
    run.odometry_from_map = Pose(0.3, -0.2, 0.1)
    drawn = pictures(run, "ft")
    assert list(drawn) == ["raw", "segments", "clusters", "models", "path"]
    assert {"path", "known-path", "loops", "certainty"} <= gids(drawn["path"])
    assert "bookmark-1" not in gids(drawn["path"]), "only odometry's places of them are known"
    (body,) = (one for one in drawn["path"].findobj(Circle) if one.get_gid() == "robot")
    assert run.last is not None
    here = run.odometry_from_map.inverse().compose(run.last.pose)
    assert np.allclose(body.get_center(), Canvas(run, "ft").frame.points(np.array([[here.x, here.y]]))[0])
    assert any("1 loop closure;" in text.get_text() for text in drawn["path"].findobj(Text))


def test_a_hall_of_the_paper_is_named_by_its_figures() -> None:
    assert paper_figures(RUN) == (6, 7, 8, 9)
    other = synthetic_timeline()
    other.world = load_world("irregular")
    assert paper_figures(other) == (10, 11, 12, 13)
    assert paper_figures(synthetic_timeline(with_world=False)) is None
    with styled():
        titles = [figure.get_suptitle() for figure in pictures(RUN, "m").values()]
    assert titles == [
        f"{name}, as the paper's Figure {k}"
        for k, name in enumerate(("Raw data", "Segments", "Clusters", "Matched models"), 6)
    ]


def test_a_run_without_a_snapshot_has_no_figures() -> None:
    empty = synthetic_timeline()
    empty.snapshots.clear()
    assert pictures(empty, "m") == {}


@pytest.mark.parametrize(("units", "unit_m"), [("m", 1.0), ("ft", 0.3048)])
def test_a_canvas_has_the_proportions_and_units_of_the_run(units: str, unit_m: float) -> None:
    canvas = Canvas(RUN, units)  # type: ignore[arg-type]
    assert canvas.frame.unit_m == unit_m
    figure, axes = canvas.figure()
    width, height = figure.get_size_inches()
    assert width == WIDTH_IN
    assert HEIGHT_MIN_IN <= height <= HEIGHT_MAX_IN
    assert (axes.get_xlabel(), axes.get_aspect()) == (f"x ({units})", 1.0)
