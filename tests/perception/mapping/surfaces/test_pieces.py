"""Straight pieces that grow in cells: along a wall, not over a doorway, and to where the wall is surely there."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.kernel import Floats
from perception.mapping.surfaces.parameters import (
    CELL_M,
    CELLS,
    DIRECTIONS,
    OFF_LINE_M,
    STRENGTH_MIN,
    SURFACE_CELLS_MAX,
    WHOLE,
    WHOLE_PASS,
)
from perception.mapping.surfaces.pieces import (
    ROW_PARTS,
    SEED_CELLS,
    STRONG,
    TAKEN_WEIGHT,
    best_direction,
    capture,
    grow_all,
    offset_of,
    order_cells,
)
from perception.mapping.surfaces.records import ANGLES, BLOCK, FREE, CellCounts, LocalMap
from perception.records import Records, Structured, records, zeros


def mapped(points: Floats, echoes: float = 3.0) -> tuple[Records[LocalMap], Structured, Structured]:
    """Return a map, in two views, whose cells at some places (m from the centre) have been heard, and its counts."""
    counts, local = zeros(CellCounts, 1), zeros(LocalMap, 1)
    for x, y in points:
        i, j = math.floor(x / CELL_M) + CELLS // 2, math.floor(y / CELL_M) + CELLS // 2
        for b in range(DIRECTIONS // 2):
            counts["hits"][0, b, i, j] = int(echoes * WHOLE / 3)
        counts["all_hits"][0, i, j] = int(echoes * WHOLE / 3) * (DIRECTIONS // 2)
        counts["block_hits"][0, i // BLOCK, j // BLOCK] = 1
    room, seen = records(LocalMap, local), records(CellCounts, counts)
    assert capture(room[0], seen[0], 0, 10**6) == ROW_PARTS
    order_cells(room, seen)
    return room, local, counts


def grown(points: Floats) -> Structured:
    """Return the pieces in such a map, the longest first."""
    room, local, counts = mapped(points)
    assert grow_all(room[0], records(CellCounts, counts)[0], 10**9)
    found = local["pieces"][0, : int(local["piece_count"][0])]
    longest: Structured = found[np.argsort(found["low"] - found["high"])]
    return longest


def line(x1: float, y1: float, x2: float, y2: float) -> Floats:
    shares = np.linspace(0.0, 1.0, 1 + int(math.hypot(x2 - x1, y2 - y1) / 0.02))[:, None]
    return np.asarray(np.array([x1, y1]) + shares * (np.array([x2, y2]) - np.array([x1, y1])))


@pytest.mark.parametrize("turn", [0.0, 0.3, 1.0, 1.6, 2.5])
def test_a_wall_is_one_piece_with_its_ends(turn: float) -> None:
    ends = np.array([[-1.5, 0.4], [1.3, 0.4]]) @ np.array(
        [[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]]
    )
    pieces = grown(line(*ends.ravel()))
    assert len(pieces) == 1
    piece = pieces[0]
    assert piece["high"] - piece["low"] == pytest.approx(2.8, abs=0.1)
    off = (ends - (piece["x"], piece["y"])) @ np.array([-piece["uy"], piece["ux"]])
    assert np.abs(off).max() < 0.03


def test_a_doorway_parts_a_wall_and_a_corner_parts_two() -> None:
    pieces = grown(np.concatenate([line(-2.0, 0.0, -0.4, 0.0), line(0.4, 0.0, 2.0, 0.0), line(2.0, 0.0, 2.0, 1.5)]))
    assert len(pieces) == 3
    np.testing.assert_allclose(pieces["high"] - pieces["low"], [1.6, 1.6, 1.5], atol=0.15)


@pytest.mark.parametrize("at", [0.0, 0.02, 0.04])
def test_parallel_surfaces_ten_centimetres_apart_are_two(at: float) -> None:
    pieces = grown(np.concatenate([line(-1.0, at, 1.0, at), line(-0.3, at + 0.1, 0.9, at + 0.1)]))
    np.testing.assert_allclose(pieces["high"] - pieces["low"], [2.0, 1.2], atol=0.15)


def test_the_strongest_cells_come_first() -> None:
    local, counts = zeros(LocalMap, 1), zeros(CellCounts, 1)
    strengths = np.random.default_rng(4).gamma(2.0, 3.0, 3000).round(1)
    strengths[:5] = 1e4, 256.0, 255.9, 0.0, 300.0
    local["cells"]["strength"][0, :3000], local["cell_count"] = strengths, 3000
    order_cells(records(LocalMap, local), records(CellCounts, counts))
    steps = np.minimum(strengths * 256.0, 65535.0).astype(int)
    np.testing.assert_array_equal(counts["order"][0, :3000], np.argsort(-steps, kind="stable"))


def test_a_search_in_parts_finds_the_same() -> None:
    """Cells are captured some at a time, and pieces grow some at a time."""
    points = np.concatenate([line(-2.0, 0.0, -0.4, 0.0), line(0.4, 0.0, 2.0, 0.0), line(2.0, 0.0, 2.0, 1.5)])
    _, whole, heard = mapped(points)
    local = zeros(LocalMap, 1)
    room = records(LocalMap, local)
    heard["index"] = 0
    counts, at, parts = records(CellCounts, heard)[0], 0, 0
    while at < ROW_PARTS:
        at, parts = at + capture(room[0], counts, at, 10), parts + 1
    assert parts > 5
    np.testing.assert_array_equal(local["cells"], whole["cells"])
    parts = 1
    while not grow_all(room[0], counts, 50):
        parts += 1
    assert parts > 3
    np.testing.assert_array_equal(
        np.sort(local["pieces"]["low"][0, : int(local["piece_count"][0])]), np.sort(grown(points)["low"])
    )


@pytest.mark.parametrize(("strength", "count"), [(STRENGTH_MIN + 0.1, 1), (STRENGTH_MIN - 0.1, 0)])
def test_weak_cells_start_no_piece_and_extend_none(strength: float, count: int) -> None:
    """They may be points of polylines only; those along a piece are its own."""
    room, local, counts = mapped(np.concatenate([line(-1.0, 0.0, 0.0, 0.0), line(0.05, 0.0, 1.0, 0.0)]))
    cells = local["cells"][0, : int(local["cell_count"][0])]
    along = (cells["i"] + 0.5 - 0.5 * CELLS) * CELL_M
    cells["strength"][along > 0.0] = strength
    order_cells(room, records(CellCounts, counts))
    assert grow_all(room[0], records(CellCounts, counts)[0], 10**9)
    piece = local["pieces"][0, 0]
    assert local["piece_count"][0] == 1
    assert (cells["owner"][along < 0.0] == 0).all()
    assert (cells["owner"][along > 0.1] == (0 if count else FREE)).all()
    assert piece["high"] - piece["low"] < 1.1  # it ends at strong cells
    cells["strength"], cells["owner"], local["piece_count"], local["at"] = strength, FREE, 0, 0
    assert grow_all(room[0], records(CellCounts, counts)[0], 10**9)
    assert local["piece_count"][0] <= count


def test_weak_cells_leave_room_for_strong_ones() -> None:
    _, whole, heard = mapped(np.array([[0.5, 0.0], [0.0, 0.5]]), echoes=0.4)
    assert whole["cell_count"][0] > 0, "weak cells are taken"
    assert whole["cells"]["strength"].max() < STRENGTH_MIN
    local = zeros(LocalMap, 1)
    local["cell_count"] = 3 * SURFACE_CELLS_MAX // 4
    capture(records(LocalMap, local)[0], records(CellCounts, heard)[0], 0, 10**6)
    assert local["cell_count"][0] == 3 * SURFACE_CELLS_MAX // 4
    _, strong, _ = mapped(np.array([[0.5, 0.0], [0.0, 0.5]]))
    assert strong["cell_count"][0] == whole["cell_count"][0]


def test_a_few_cells_are_no_piece() -> None:
    room, local, counts = mapped(line(0.0, 0.0, 0.12, 0.0))
    assert not grow_all(room[0], records(CellCounts, counts)[0], 0)
    assert grow_all(room[0], records(CellCounts, counts)[0], 100_000)
    assert local["piece_count"][0] == 0
    assert (local["cells"]["owner"][0, : int(local["cell_count"][0])] == FREE).all()


def test_the_direction_through_a_seed_meets_most_cells() -> None:
    """As a loop over the directions has it."""
    rng = np.random.default_rng(3)
    room, local, counts = mapped(np.concatenate([line(-0.4, -0.2, 0.4, 0.3), rng.uniform(-0.45, 0.45, (30, 2))]))
    count = int(local["cell_count"][0])
    cells = local["cells"][0, :count]
    cells["owner"][::3] = 0
    for seed in range(0, count, 5):
        scores = []
        for a in range(ANGLES):
            angle = math.pi * a / ANGLES
            near = (
                np.maximum(np.abs(cells["i"] - cells["i"][seed]), np.abs(cells["j"] - cells["j"][seed])) <= SEED_CELLS
            )
            across = (cells["j"] - cells["j"][seed]) * math.cos(angle) - (cells["i"] - cells["i"][seed]) * math.sin(
                angle
            )
            share = np.maximum(1.0 - (across * CELL_M / OFF_LINE_M) ** 2, 0.0)
            weight = np.minimum(cells["strength"], STRONG) * np.where(cells["owner"] == FREE, 1.0, TAKEN_WEIGHT)
            scores.append(float((near * weight * share).sum()))
        found = best_direction(room[0].cells, records(CellCounts, counts)[0], seed)
        assert scores[round(found * ANGLES / math.pi)] == pytest.approx(max(scores), rel=1e-9)


def test_places_of_cells() -> None:
    assert offset_of(CELLS // 2) == pytest.approx(0.5 * CELL_M)


def test_the_cells_of_pieces_say_how_often_surfaces_answer() -> None:
    """A wall is heard from six directions. In one of them each range of its left half passed three times."""
    along = np.arange(-1.0, 1.0, CELL_M) + 0.5 * CELL_M
    room, local, counts = mapped(np.column_stack([along, np.full(len(along), 0.5 * CELL_M)]))
    passed = counts["passes"][0]
    passed[0, CELLS // 4 - 10 : CELLS // 4, CELLS // 4] = 3 * WHOLE_PASS
    passed[DIRECTIONS - 1] = 5 * WHOLE_PASS  # nothing is heard from there
    assert grow_all(room[0], records(CellCounts, counts)[0], 10**9)
    assert local["piece_count"][0] == 1
    assert room[0].passed == pytest.approx(3.0 * len(along) / 2)
    # 5 cells around each that are heard, fewer at the ends.
    assert room[0].heard == pytest.approx(6.0 * (5 * len(along) - 6))
