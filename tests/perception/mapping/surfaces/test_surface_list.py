"""Surfaces that replace others, and points near segments against plain geometry."""

from __future__ import annotations

import numpy as np

from perception.map_moves import MapMoves
from perception.mapping.surfaces.surface_list import ENDS, Surface, SurfaceList, find_near, is_covered
from perception.records import Structured, zeros


def rows(*ends: tuple[float, float, float, float], number: int = -1) -> Structured:
    """Return straight pieces between these ends, of the present local map, or parts of a polyline."""
    made = zeros(Surface, len(ends))
    made["number"] = number
    for row, end in zip(made, ends, strict=True):
        for name, value in zip(ENDS, end, strict=True):
            row[name] = value
    made["is_live"] = 1
    return made


def test_points_near_segments() -> None:
    rng = np.random.default_rng(2)
    points, ends = rng.uniform(-2.0, 2.0, (200, 2)), rng.uniform(-2.0, 2.0, (7, 4))
    found = np.zeros(200, np.int64)
    reaches = rng.uniform(0.0, 0.5, 7)
    find_near(points, ends, reaches, found)
    shares = np.linspace(0.0, 1.0, 2001)[:, None, None]
    dense = ends[:, :2] + shares * (ends[:, 2:] - ends[:, :2])
    nearest = np.array([np.hypot(*(dense - point).transpose(2, 0, 1)).min(axis=0) - reaches for point in points])
    most = nearest.min(axis=1)
    clear = np.flatnonzero(np.abs(most) > 2e-3)
    np.testing.assert_array_equal(found[clear] == 1, most[clear] < 0.0)


def test_a_surface_is_covered_by_a_longer_one_only() -> None:
    long, short = rows((0.0, 0.0, 3.0, 0.0)), rows((1.0, 0.05, 1.5, 0.05))
    assert is_covered(short, long).tolist() == [True]
    assert is_covered(long, short).tolist() == [False]
    assert is_covered(short, rows()).tolist() == [False]


def test_a_polyline_covers_no_piece() -> None:
    piece, line = rows((0.0, 0.0, 3.0, 0.0)), rows((-0.1, 0.0, 3.1, 0.0), number=1)
    assert is_covered(piece, line).tolist() == [False]
    assert is_covered(line[:1], rows((-0.2, 0.0, 3.2, 0.0))).tolist() == [True]
    both = np.concatenate([piece, line])
    assert is_covered(both, both).tolist() == [True, True]


def test_what_is_left_behind_stays_until_it_is_seen_anew() -> None:
    listed = SurfaceList()
    listed.replace_live(rows((0.0, 0.0, 3.0, 0.0), (5.0, 0.0, 5.0, 2.0)))
    assert len(listed.archived_rows) == 2
    listed.leave()
    listed.replace_live(rows((1.0, 0.02, 1.4, 0.02), (4.9, -0.1, 5.05, 2.2)))
    assert listed.left_behind["x2"].tolist() == [3.0]  # a part of it that is heard again says less
    live = listed.archived_rows[listed.archived_rows["is_live"] == 1]
    assert live["x1"].tolist() == [4.9]  # this one shows the second wall whole
    listed.clear()
    assert len(listed.archived_rows) == 0


def test_surfaces_move_with_their_maps_of_the_way() -> None:
    held = SurfaceList()
    held.replace_live(rows((0.0, 0.0, 1.0, 0.0), (0.0, 2.0, 1.0, 2.0)))
    held.archived_rows["submap"] = 0, 7
    held.move(MapMoves(np.array([[0.0, 0.0, 0.5 * np.pi], [0.0, 0.1, 0.0]]), np.zeros((2, 2))))
    np.testing.assert_allclose(
        [[row[name] for name in ENDS] for row in held.archived_rows],
        [[0.0, 0.0, 0.0, 1.0], [0.0, 2.1, 1.0, 2.1]],
        atol=1e-12,
    )
