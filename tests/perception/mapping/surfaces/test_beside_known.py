"""What is reported of the map of surfaces: beside what the method knows, or in place of its walls."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from perception.detected_object import DetectedObject, wall_between
from perception.mapping.no_surfaces import SurfaceReport
from perception.mapping.surfaces.beside_known import beside_known, nearness, refuted, replaced, wall_prior
from perception.mapping.surfaces.surface_list import ENDS, Surface
from perception.records import Structured, zeros


def pieces(*ends: tuple[float, float, float, float], evidence: float = 60.0, echoes: float = 100.0) -> Structured:
    """Return straight pieces with so many echoes a metre."""
    made = zeros(Surface, len(ends))
    for k, (row, end) in enumerate(zip(made, ends, strict=True)):
        for name, value in zip(ENDS, end, strict=True):
            row[name] = value
        row["number"] = -1 - k
        row["echoes"] = echoes * np.hypot(end[2] - end[0], end[3] - end[1])
    made["evidence"], made["variance_across"], made["variance_turn"] = evidence, 1e-4, 1e-4
    return made


def room(height: float = 6.0) -> Structured:
    """Return the pieces of a room that the method knows nothing of."""
    corners = [(0.0, 0.0), (8.0, 0.0), (8.0, height), (0.0, height), (0.0, 0.0)]
    return pieces(*[(*a, *b) for a, b in itertools.pairwise(corners)])


def known_wall(x1: float, y1: float, x2: float, y2: float, number: int = 7) -> DetectedObject:
    return wall_between((x1, y1, x2, y2), 1e-6, 1e-6, 50, 9.0, number)


def report(
    rows: Structured, known: tuple[DetectedObject, ...] = (), reach_m: dict[str, float] | None = None
) -> SurfaceReport:  # fmt: skip
    near = nearness(rows, known, reach_m or {})
    return beside_known(rows, near, wall_prior(rows, near))


def test_pieces_in_a_room_that_the_method_does_not_know_are_walls() -> None:
    walls, polylines, *_ = report(room(), (), {})
    assert sorted(round(np.hypot(w.ends[2] - w.ends[0], w.ends[3] - w.ends[1])) for w in walls if w.ends) == [
        6,
        6,
        8,
        8,
    ]
    assert all((w.probability or 0.0) > 0.99 and w.number is None for w in walls)
    assert polylines == ()


def test_where_little_is_known_pieces_stand_for_the_walls() -> None:
    """They are reported whole, though a wall of the method lies along one; but a drum's outline is no wall."""
    drum = DetectedObject("drum", 8.0, 3.0, 0.0, 0.01, 9, 1.0)
    found = report(room(), (known_wall(0.0, 0.03, 4.0, 0.03), drum), {"drum": 0.3})
    ends = np.array([w.ends for w in found.walls])
    assert ((ends[:, 1] == 0.0) & (ends[:, 0] == 0.0) & (ends[:, 2] == 8.0)).any()
    beside = ends[(ends[:, 0] == 8.0) & (ends[:, 2] == 8.0)]
    assert len(beside) == 2
    assert not ((beside[:, [1, 3]].min(axis=1) < 3.0) & (beside[:, [1, 3]].max(axis=1) > 3.0)).any()


def test_where_little_is_known_a_post_hides_no_outline() -> None:
    """It is a guess, and no result names it; a drum is one. What is on it of a wall's piece is outline, too."""
    rows = np.concatenate([room(), pieces((4.0, 3.0, 4.05, 3.0))])
    rows["number"][-1] = 9
    for name, there in (("post", True), ("drum", False)):
        bodies = tuple(DetectedObject(name, x, y, 0.0, 0.01, 9, 1.0) for x, y in ((4.0, 3.1), (8.0, 3.0)))
        found = report(rows, bodies, {name: 0.2})
        outlines = [line.points for line in found.polylines]
        assert [(points[:, 1] == 3.0).all() for points in outlines] == ([True, False] if there else [])
        if there:
            assert (outlines[1][:, 0] == 8.0).all()
            assert np.abs(outlines[1][:, 1] - 3.0).max() < 0.5
        assert not any(w.ends is not None and w.ends[0] == w.ends[2] == 8.0 and w.y == 3.0 for w in found.walls)


@pytest.mark.parametrize("known", range(5))
def test_nothing_stands_along_the_method_s_walls_once_it_knows_most(known: int) -> None:
    """Four walls are known one after the other: from some share on the method's own stand alone."""
    rows = room()
    found = report(rows, tuple(known_wall(*row) for row in zip(*(rows[name][:known] for name in ENDS), strict=True)))
    assert len(found.walls) == (4 if known < 3 else 0)


def test_a_wall_is_shown_where_no_piece_stands_along_it() -> None:
    """By half of its length, within the distance at which a surface explains an echo; not by its line."""
    found = report(room()).walls
    lines = [(0.0, 0.05, 8.0, 0.05), (0.0, 0.05, 20.0, 0.05), (0.0, 0.3, 8.0, 0.3), (10.0, 0.0, 12.0, 0.0)]
    own = tuple(known_wall(*line, 11 + k) for k, line in enumerate(lines))
    assert replaced(found, own) == {11}
    assert replaced((), own) == replaced(found, ()) == frozenset()
    shown = SurfaceReport(found, replaced=frozenset({11}), refuted=frozenset({13})).shown(own)
    assert [one.number for one in shown] == [12, 14]


def test_what_is_left_of_the_echoes_of_known_walls_is_no_wall() -> None:
    """Beside each wall a piece with as much evidence as one may have: its echoes are the wall's."""
    rows = room()
    known = tuple(known_wall(*row) for row in zip(*(rows[name] for name in ENDS), strict=True))
    beside = pieces((1.0, 0.15, 7.0, 0.12), (7.85, 1.0, 7.85, 4.0), evidence=1000.0, echoes=400.0)
    assert report(np.concatenate([rows, beside]), known).walls == ()


def test_where_the_method_explains_the_place_pieces_are_outlines() -> None:
    """A shelf in a room of walls that are known: nothing says that it is a wall."""
    known = tuple(known_wall(*row) for row in zip(*(room()[name] for name in ENDS), strict=True))
    surfaces = np.concatenate([room(), pieces((2.0, 2.0, 2.6, 2.0), evidence=1.0)])
    walls, polylines, *_ = report(surfaces, known, {})
    assert walls == ()
    assert [line.points.tolist() for line in polylines] == [[[2.0, 2.0], [2.6, 2.0]]]


def test_long_pieces_along_known_walls_show_that_there_are_walls() -> None:
    """A furnished room, of which the method knows the two long walls and nothing of what is short."""
    short = [(0.5 * k, 3.0 + 0.3 * (k % 3), 0.5 * k + 0.4, 3.2) for k in range(40)]
    rows = np.concatenate([room()[:1], pieces(*short, evidence=1.0)])
    known = (known_wall(0.0, 0.0, 8.0, 0.0),)
    assert wall_prior(rows, nearness(rows, known, {})) > 0.0
    assert wall_prior(rows, nearness(rows, (), {})) > 0.0


@pytest.mark.parametrize("radius", [0.3, 0.6])
def test_pieces_of_round_bodies_alone_are_no_walls(radius: float) -> None:
    """Each has short straight pieces; nothing long shows that there are walls."""
    turns = np.linspace(0.0, 2.0 * np.pi, 12)
    ends = [
        (x + radius * np.cos(a), radius * np.sin(a), x + radius * np.cos(b), radius * np.sin(b))
        for x in range(0, 40, 2)
        for a, b in itertools.pairwise(turns)
    ]
    walls, polylines, *_ = report(pieces(*ends, evidence=2.0), (), {})
    assert walls == ()
    assert len(polylines) > 100


def test_a_piece_on_an_unknown_object_is_an_outline_where_the_method_explains_the_place() -> None:
    """It may be as large as the largest body. It is not known, so that it says nothing of the place."""
    known = tuple(known_wall(*row) for row in zip(*(room()[name] for name in ENDS), strict=True))
    rows = np.concatenate([room(), pieces((3.0, 3.0, 4.2, 3.0), evidence=100.0)])
    unknown, reach_m = DetectedObject("unknown", 3.6, 2.5, 0.0, 0.01, 9, 1.0), {"drum": 0.3, "barrel": 0.7}
    free, taken = (nearness(rows, objects, reach_m) for objects in (known, (*known, unknown)))
    assert wall_prior(rows, taken) == wall_prior(rows, free) < 0.0
    assert len(beside_known(rows, free, -1.0).walls) == 1
    assert beside_known(rows, taken, -1.0).walls == ()
    assert len(beside_known(rows, taken, 1.0).walls) == 1 + len(beside_known(rows[:-1], taken[:-1], 1.0).walls)


@pytest.mark.parametrize(("probability", "straight", "is_refuted"), [
    (0.996, -4.0, True), (0.996, -30.0, False), (1.0 - 1e-9, 0.0, False), (1.0 - 1e-9, 10.0, True), (1.0, 0.0, False),
])  # fmt: skip
def test_what_seems_round_among_straight_pieces_needs_evidence(
    probability: float, straight: float, is_refuted: bool
) -> None:
    """That of the pieces at its outline counts as well; those farther away say nothing."""
    drum = DetectedObject("drum", 2.0, 2.0, 0.0, 0.01, 9, probability, probability, number=5)
    rows = np.concatenate([pieces((1.8, 1.7, 2.2, 1.7), evidence=straight), pieces((1.0, 1.0, 3.0, 1.0))])
    assert refuted(rows, (drum,), {"drum": 0.3}) == (frozenset({5}) if is_refuted else frozenset())
    assert refuted(rows, (drum,), {"barrel": 0.2}) == frozenset()


def test_a_short_piece_is_a_wall_among_walls_but_says_nothing_against_a_round_object() -> None:
    short = pieces((3.0, 3.0, 3.2, 3.0), evidence=-8.0)
    walls = report(np.concatenate([room(), short])).walls
    assert len(walls) == 5
    drum = DetectedObject("drum", 3.1, 3.3, 0.0, 0.01, 9, 1.0, 1.0 - 1e-8, number=4)
    assert 4 not in refuted(np.concatenate([room(), pieces((3.0, 3.0, 3.2, 3.0))]), (drum,), {"drum": 0.3})
    assert 4 in refuted(np.concatenate([room(), pieces((2.9, 3.0, 3.3, 3.0))]), (drum,), {"drum": 0.3})


def test_a_polyline_keeps_its_points_in_order() -> None:
    parts = pieces((0.0, 0.0, 0.1, 0.1), (0.1, 0.1, 0.2, 0.1), (0.5, 0.5, 0.55, 0.5))
    parts["number"], parts["echoes"] = [4, 4, 5], 2.0
    polylines = report(parts).polylines
    assert [(line.number, line.points.tolist()) for line in polylines] == [
        (4, [[0.0, 0.0], [0.1, 0.1], [0.2, 0.1]]),
        (5, [[0.5, 0.5], [0.55, 0.5]]),
    ]
    assert all(0.8 < line.probability < 0.9 for line in polylines)
