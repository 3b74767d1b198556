"""Tests of the layers of figures: each draws what it should, under the id by which it is found."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.text import Annotation

from config.units import FOOT_M
from drivers.messages import Pose
from runtime.analysis.plots import layers
from runtime.analysis.plots.geometry import Frame
from runtime.analysis.plots.paper_figures import Canvas
from runtime.analysis.timeline import BookmarkEntry
from tests.polylines import BEND
from tests.runtime.analysis.synthetic_timeline import ERROR_M, SETTINGS, synthetic_timeline, with_cross_paths

RUN = synthetic_timeline()
LAST = RUN.snapshots[-1]
FRAME = Frame(RUN.start, 1.0)
LEAST = SETTINGS.perception.clusters.segments_min


@pytest.fixture
def axes() -> Axes:
    return Canvas(RUN, "m").figure()[1]


def gids(axes: Axes) -> list[str]:
    return sorted(gid for artist in axes.get_children() if (gid := artist.get_gid()) is not None)


def texts(axes: Axes) -> Iterator[str]:
    return (child.get_text() for child in axes.get_children() if isinstance(child, Annotation))


def test_the_true_world_is_drawn_if_it_is_known(axes: Axes) -> None:
    assert layers.draw_world(axes, synthetic_timeline(with_world=False), FRAME) == []
    assert gids(axes) == []
    (entry,) = layers.draw_world(axes, RUN, FRAME)
    assert (entry.get_label(), gids(axes)) == ("truth", ["truth"])


def test_the_robot_stands_at_the_end_of_its_path(axes: Axes) -> None:
    assert layers.draw_path(axes, [], FRAME, 0.2) == []
    layers.draw_path(axes, [s.pose for s in RUN.snapshots], FRAME, 0.2)
    assert gids(axes) == ["heading", "path", "robot"]
    (path,) = (line for line in axes.lines if line.get_gid() == "path")
    assert np.asarray(path.get_xdata()) == pytest.approx([-1.8288 + 0.3 * k for k in range(4)])
    (heading,) = (line for line in axes.lines if line.get_gid() == "heading")
    assert np.ptp(np.asarray(heading.get_xdata())) == pytest.approx(0.2)


def test_a_bookmark_is_a_number_where_the_robot_was(axes: Axes) -> None:
    marks = [BookmarkEntry(0.0, "before the first pose", None), BookmarkEntry(1.0, "b", Pose(1.0, 0.0, 0.0))]
    assert layers.draw_bookmarks(axes, marks[:1], FRAME) == []
    layers.draw_bookmarks(axes, marks, FRAME)
    assert gids(axes) == ["bookmark-2"]
    assert list(texts(axes)) == ["2"]


def test_many_echoes_are_thinned_and_those_without_a_range_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(RUN.echoes) == 12
    assert len(layers.received_echoes(RUN.echoes)) == 9
    monkeypatch.setattr(layers, "ARCS_MAX", 4)
    assert len(layers.received_echoes(RUN.echoes)) == 3


def test_echoes_are_one_path_of_arcs(axes: Axes) -> None:
    layers.draw_arcs(axes, RUN.echoes[:0], 0.2, FRAME)
    assert gids(axes) == []
    layers.draw_arcs(axes, layers.received_echoes(RUN.echoes), 0.2, FRAME)
    assert gids(axes) == ["echoes"]


def test_cross_paths_are_one_collection_of_arcs(axes: Axes) -> None:
    run = with_cross_paths(synthetic_timeline())
    assert layers.draw_cross_paths(axes, run.cross_paths[:0], 0.2, FRAME) == []
    (entry,) = layers.draw_cross_paths(axes, run.cross_paths[:2], 0.2, FRAME)
    assert (entry.get_label(), gids(axes)) == ("cross path, its ellipse", ["cross-paths"])


def test_segments_are_one_collection(axes: Axes) -> None:
    layers.draw_segments(axes, LAST.segments, FRAME, faint=True)
    (lines,) = axes.collections
    assert lines.get_gid() == "segments"
    assert len(lines.get_paths()) == len(LAST.segments) == 3


def test_small_clusters_differ_from_those_that_are_matched(axes: Axes) -> None:
    entries = layers.draw_clusters(axes, LAST.clusters, LEAST, FRAME)
    assert [entry.get_label() for entry in entries] == [f"cluster of fewer than {LEAST}", "cluster, X its centre"]
    assert gids(axes) == sorted(f"cluster-{k}{part}" for k in (1, 2, 3) for part in ("", "-centre"))
    dashes = [patch.get_linestyle() for patch in axes.patches]
    assert dashes == ["-", "-", ":"]


def test_each_object_has_shape_ellipse_centre_name_and_error(axes: Axes) -> None:
    run = synthetic_timeline()
    layers.draw_objects(axes, LAST.objects, run, Frame(run.start, FOOT_M), "ft")
    assert gids(axes) == sorted(f"{part}-{k}" for k in (1, 2, 3) for part in ("model", "ellipse", "centre"))
    assert sorted(texts(axes)) == [f"drum {k}\n{ERROR_M / FOOT_M:.3f} ft" for k in (1, 2, 3)]


def test_without_a_known_world_objects_have_numbers(axes: Axes) -> None:
    unknown = synthetic_timeline(with_world=False)
    layers.draw_objects(axes, LAST.objects, unknown, FRAME, "m")
    assert sorted(texts(axes)) == ["1", "2", "3"]
    assert layers.match_to_truth(LAST.objects, unknown) == {}


def test_objects_match_the_nearest_drum_within_the_gate() -> None:
    far = replace(LAST.objects[2], y=LAST.objects[2].y + 5.0)
    matched = layers.match_to_truth([*LAST.objects[:2], far], RUN)
    assert {j: one.name for j, one in matched.items()} == {0: "drum 1", 1: "drum 2"}
    assert all(math.isclose(one.error_m, ERROR_M, rel_tol=1e-6) for one in matched.values())


def test_polylines_are_one_collection_thinner_than_walls(axes: Axes) -> None:
    assert layers.draw_polylines(axes, (), FRAME) == []
    (entry,) = layers.draw_polylines(axes, (BEND,), FRAME)
    (drawn,) = (one for one in axes.collections if one.get_gid() == "polylines")
    assert drawn.get_paths()[0].vertices == pytest.approx(FRAME.points(BEND.points))
    (wall,) = layers.draw_walls(axes, LAST.walls, FRAME)
    assert entry.get_linewidth() < 0.6 * wall.get_linewidth()
