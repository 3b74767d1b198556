"""The arcs of cross paths: on their ellipses, within the beams, and no others."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.firing_pattern import LISTENING_LOBE
from runtime.analysis.plots.cross_arcs import cross_arcs, heard_cross_paths, newest_cross_paths
from runtime.analysis.timeline import CROSS_PATH, CrossPathRows

BEAM = math.radians(30.0)


def paths(*rows: tuple[int, float]) -> CrossPathRows:
    """Return paths of a ring of 24 from sensor 3 to others: listener, half path; one a second."""
    made = np.empty(len(rows), CROSS_PATH)
    for k, (listener, half_m) in enumerate(rows):
        t, l = math.radians(45.0), math.radians(15.0 * listener)  # noqa: E741
        places = (0.381 * math.cos(t), 0.381 * math.sin(t), t, 0.381 * math.cos(l), 0.381 * math.sin(l), l)
        made[k] = (float(k), 3, listener, *places, half_m, float(k))
    return made


def test_an_arc_is_the_part_of_the_ellipse_in_both_beams() -> None:
    rng = np.random.default_rng(1)
    rows = paths(*((int(rng.integers(-1, 8)), float(rng.uniform(0.7, 5.0))) for _ in range(60)))
    rows = rows[rows["listener"] != 3]
    arcs = cross_arcs(rows, BEAM)
    full = 0
    for row, arc in zip(rows, arcs, strict=True):
        t, l = (row["x"], row["y"]), (row["listener_x"], row["listener_y"])  # noqa: E741
        way = np.hypot(*(arc - t).T) + np.hypot(*(arc - l).T)
        assert way == pytest.approx(2.0 * row["half_path_m"])
        off = []
        for place, bearing in ((t, row["bearing"]), (l, row["listener_bearing"])):
            turn = np.arctan2(arc[:, 1] - place[1], arc[:, 0] - place[0]) - bearing
            off.append(abs(np.angle(np.exp(1j * turn))))
        assert off[0].max() < BEAM + 1e-9
        assert off[1].max() < LISTENING_LOBE * BEAM + 1e-9
        if off[1].max() < BEAM + 1e-9:
            full += 1
            assert np.maximum(*off)[[0, -1]] == pytest.approx(BEAM), "it ends where a beam does"
    assert full > 30


def test_a_sensor_that_looks_away_limits_no_arc() -> None:
    (arc,) = cross_arcs(paths((15, 3.0)), BEAM)
    bearing = np.arctan2(*(arc - 0.381 * math.sqrt(0.5)).T[::-1])
    assert bearing[[0, -1]] == pytest.approx([math.radians(15.0), math.radians(75.0)])


def test_paths_that_no_surface_explains_have_no_arc() -> None:
    assert heard_cross_paths(paths((4, math.inf), (15, 0.3), (4, 2.0)))["t_s"].tolist() == [2.0]
    assert cross_arcs(paths(), BEAM).shape == (0, 9, 2)


def test_the_newest_are_of_the_last_second() -> None:
    assert newest_cross_paths(paths((4, 1.0), (5, 1.0), (2, 1.0)), 1.9)["listener"].tolist() == [5]
