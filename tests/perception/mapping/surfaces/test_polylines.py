"""Polylines through cells for which no piece stands."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.mapping.surfaces.parameters import (
    CELL_M,
    CELLS,
    DIRECTIONS,
    LINK_M,
    NODE_M,
    PIECE_MIN_M,
    STRENGTH_MIN,
    WEAK_MIN,
    WHOLE_PASS,
)
from perception.mapping.surfaces.polylines import chain_all, choose_nodes, is_unclaimed, pass_nat
from perception.mapping.surfaces.records import CHAIN_MAX, FREE, NODE, CellCounts
from perception.records import records
from tests.perception.mapping.surfaces.test_pieces import mapped


def chains(points: np.ndarray, echoes: float = 3.0) -> list[np.ndarray]:
    """Return the polylines through places that were heard, as places (m)."""
    room, local, counts = mapped(points, echoes)
    view, count = records(CellCounts, counts)[0], int(local["cell_count"][0])
    choose_nodes(room[0], view, 0, count)
    chain_all(room[0], view, 0, count)
    numbers = local["chains"][0, : int(local["chained"][0])]
    cells = local["cells"][0]
    parts = [part[part > 0] - 1 for part in np.split(numbers, np.flatnonzero(numbers == 0) + 1)]
    assert (cells["owner"][:count] != NODE).all()
    return [np.column_stack([cells["i"][p], cells["j"][p]]) * CELL_M for p in parts if len(p)]


def test_a_bend_is_one_polyline_in_order() -> None:
    angles = np.linspace(0.0, 2.0, 200)
    found = chains(np.column_stack([np.cos(angles), np.sin(angles)]))
    assert len(found) == 1
    steps = np.hypot(*np.diff(found[0], axis=0).T)
    assert (steps >= NODE_M - 1e-9).all()
    assert (steps <= LINK_M + CELL_M).all()
    assert steps.sum() == pytest.approx(2.0, abs=0.3)


def test_objects_apart_are_polylines_apart() -> None:
    found = chains(np.array([[0.0, 0.0], [1.0, 1.0], [1.1, 1.05], [3.0, -2.0]]))
    assert sorted(len(one) for one in found) == [1, 1, 2]


def test_a_point_needs_echoes_that_agree() -> None:
    """A stray leaves one; each of these cells has one and a half."""
    stray = [[3.0, -2.0]]
    assert chains(np.array([[0.0, 0.0], *stray]), echoes=0.7) == []
    assert len(chains(np.array([[0.0, 0.0], [0.1, 0.05], *stray]), echoes=0.7)) == 1
    assert chains(np.array([[0.0, 0.0], [0.2, 0.0], *stray]), echoes=0.7) == []


def test_weak_cells_are_points_where_more_agree() -> None:
    """Each of these has .8 of an echo in all, spread over six directions: four of them agree, two do not."""
    square = np.array([[0.0, 0.0], [0.0, 0.1], [0.1, 0.0], [0.1, 0.1]])
    _, local, _ = mapped(square, 0.36)
    strengths = local["cells"]["strength"][0, :4]
    assert ((strengths > WEAK_MIN) & (strengths < STRENGTH_MIN)).all()
    assert sum(map(len, chains(square, 0.36))) > 0
    assert chains(square[:2], 0.36) == []


@pytest.mark.parametrize(("answering", "directions", "is_left"), [
    (0.9, range(6), False), (0.9, range(6, DIRECTIONS), True), (0.2, range(6), True), (0.9, range(1), True),
])  # fmt: skip
def test_passes_speak_against_a_point_where_the_pieces_answer(
    answering: float, directions: range, is_left: bool
) -> None:
    """It is heard from the first six directions, from each by half an echo; two ranges passed in each."""
    room, local, counts = mapped(np.array([[0.0, 0.0]]), 1.5)
    counts["passes"][0, list(directions), CELLS // 4, CELLS // 4] = 2 * WHOLE_PASS
    room[0].heard, room[0].passed = 1000.0 * answering, 1000.0 * (1.0 - answering)
    assert pass_nat(room[0]) == pytest.approx(math.log(1.0 - answering), abs=0.01)
    choose_nodes(room[0], records(CellCounts, counts)[0], 0, 1)
    assert (local["cells"]["owner"][0, 0] == NODE) == is_left


def test_passes_say_nothing_before_there_are_pieces() -> None:
    room, _, _ = mapped(np.array([[0.0, 0.0]]))
    assert pass_nat(room[0]) == 0.0


def test_cells_of_a_piece_that_does_not_reach_them_are_left() -> None:
    points = np.column_stack([np.arange(0.0, 1.0, CELL_M), np.zeros(20)])
    room, local, _ = mapped(points)
    cells = local["cells"][0, :20]
    cells["owner"] = 0
    piece = local["pieces"][0, 0]
    piece["ux"], piece["low"], piece["high"] = 1.0, 0.0, 0.5
    along = (cells["i"] + 0.5 - 0.5 * CELLS) * CELL_M
    left = [is_unclaimed(room[0], room[0].cells[k]) for k in range(20)]
    np.testing.assert_array_equal(left, along > 0.5 + CELL_M)
    piece["high"] = 0.5 * PIECE_MIN_M
    assert all(is_unclaimed(room[0], room[0].cells[k]) for k in range(20))


def test_a_long_outline_is_cut() -> None:
    along = np.arange(0.0, 0.1 * (CHAIN_MAX + 20), 0.02)
    found = chains(np.column_stack([along - 4.0, 0.2 * np.sin(3.0 * along)]))
    assert max(len(one) for one in found) <= CHAIN_MAX
    assert math.isclose(FREE, -1)
