"""The cells of a map of surfaces against plain geometry, and that what a reading puts there can be taken away."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.mapping.surfaces import cells
from perception.mapping.surfaces.parameters import (
    CELL_M,
    CELLS,
    DIRECTIONS,
    NEARER_M,
    REACH_M,
    SAMPLES,
    WHOLE,
    WHOLE_PASS,
)
from perception.mapping.surfaces.records import BLOCK, CellCounts, KeptReading, LocalMap
from perception.records import Records, array_of, records, zeros
from perception.shared_numbers import SILENCE_M

HALF = math.radians(12.0)
COUNTS = ("hits", "all_hits", "passes", "all_passes")


def some(count: int, seed: int = 1) -> Records[KeptReading]:
    """Return readings from around the map's centre; some are silent."""
    rng = np.random.default_rng(seed)
    array = zeros(KeptReading, count)
    array["x"], array["y"] = rng.uniform(-1.0, 1.0, (2, count))
    array["axis"] = rng.uniform(-7.0, 7.0, count)
    array["range_m"] = np.where(rng.random(count) < 0.2, 1e6, rng.uniform(0.05, REACH_M, count))
    return records(KeptReading, array)


@pytest.mark.parametrize(
    "half_deg", [12.0, 45.0, *(pytest.param(one, marks=pytest.mark.soak) for one in (5.0, 30.0))]
)
@pytest.mark.parametrize("range_m", [0.6, 5.0, 1e6, pytest.param(2.0, marks=pytest.mark.soak)])
def test_passes_are_the_cells_of_the_beam_before_the_range(half_deg: float, range_m: float) -> None:
    counts = zeros(CellCounts, 1)
    readings = some(5)
    half = math.radians(half_deg)
    far = range_m - NEARER_M if range_m <= REACH_M else SILENCE_M
    expected = np.zeros((CELLS // 2, CELLS // 2, DIRECTIONS))
    middles = (np.arange(CELLS // 2) + 0.5 - 0.25 * CELLS) * 2.0 * CELL_M
    for k in range(5):
        q = readings[k]
        q.range_m = range_m
        cells.enter_passes(records(CellCounts, counts)[0], q, half, 1)
        dx, dy = np.meshgrid(middles - q.x, middles - q.y, indexing="ij")
        off = np.arctan2(dy * math.cos(q.axis) - dx * math.sin(q.axis), dx * math.cos(q.axis) + dy * math.sin(q.axis))
        inside = (np.abs(off) < half) & (np.hypot(dx, dy) <= far)
        direction = np.floor(np.arctan2(dy, dx) / (2.0 * math.pi / DIRECTIONS)).astype(int) % DIRECTIONS
        share = np.tan(off) / math.tan(half)
        weight = (WHOLE_PASS * (1.0 - 0.5 * share**2) + 0.5).astype(int)
        rows, columns = inside.nonzero()
        np.add.at(expected, (rows, columns, direction[inside]), weight[inside])
    np.testing.assert_array_equal(counts["passes"][0].transpose(1, 2, 0), expected)
    np.testing.assert_array_equal(counts["all_passes"][0], expected.sum(axis=2))


def naive_probability(hits: np.ndarray, passes: np.ndarray, i: int, j: int, b: int) -> float:
    """Return the probability of an answer as METHODS has it, from whole echoes and passes by direction."""
    kernel = np.array([[1, 2, 1], [2, 4, 2], [1, 2, 1]]) / 16.0
    blurred = np.einsum("ijb,ij->b", hits[i - 1 : i + 2, j - 1 : j + 2], kernel) * 3.0
    went = passes[i // 2, j // 2]
    prior = (blurred.sum() + 0.03) / (blurred.sum() + went.sum() + 0.5)
    return float((blurred[b] + prior) / (blurred[b] + went[b] + 1.0))


def test_a_cell_answers_as_it_and_those_around_it_did() -> None:
    counts, rng = zeros(CellCounts, 1), np.random.default_rng(3)
    counts["hits"][0, :, 40:48, 40:48] = rng.integers(0, 3 * WHOLE, (DIRECTIONS, 8, 8))
    counts["passes"][0, :, 20:24, 20:24] = rng.integers(0, 5 * WHOLE_PASS, (DIRECTIONS, 4, 4))
    for name in ("hits", "passes"):
        counts[f"all_{name}"][0] = counts[name][0].sum(axis=0)
    hits, passes = (counts[name][0].transpose(1, 2, 0) for name in ("hits", "passes"))
    view = records(CellCounts, counts)[0]
    for i, j in ((42, 43), (45, 44), (46, 41)):
        expected = naive_probability(hits / WHOLE, passes / WHOLE_PASS, i, j, 1)
        assert cells.answer_probability(view, i, j, 1) == pytest.approx(expected)


def test_an_echo_is_shared_as_the_map_says() -> None:
    counts, readings = zeros(CellCounts, 1), some(100)
    view = records(CellCounts, counts)[0]
    cells.enter_readings(view, readings, 0, 99, 0, HALF)
    q = readings[99]
    q.range_m = 2.0
    hits, passes = (counts[name][0].transpose(1, 2, 0) for name in ("hits", "passes"))
    hits, passes = hits / WHOLE, passes / WHOLE_PASS
    likelihoods = []
    for k in range(SAMPLES):
        off = (2 * k + 1) / SAMPLES - 1
        dx, dy = 2.0 * math.cos(q.axis + off * HALF), 2.0 * math.sin(q.axis + off * HALF)
        i, j = (math.floor(v / CELL_M) + CELLS // 2 for v in (q.x + dx, q.y + dy))
        b = math.floor(math.atan2(dy, dx) / (2 * math.pi / DIRECTIONS)) % DIRECTIONS
        likelihoods.append(naive_probability(hits, passes, i, j, b))
    cells.lay_arc(view, q, HALF)
    cells.share_echo(view, q)
    expected = np.array(likelihoods) / (sum(likelihoods) + 0.005)
    shares = np.array([cells.share_of(q, k) for k in range(SAMPLES)]) / WHOLE
    np.testing.assert_allclose(shares, expected, atol=0.51 / WHOLE)


def test_what_a_reading_has_put_there_can_be_taken_away_and_made_again() -> None:
    counts, local = zeros(CellCounts, 1), zeros(LocalMap, 1)
    local["readings"][0, :60] = array_of(some(60))
    local["entered"] = 60
    view, rooms = records(CellCounts, counts)[0], records(LocalMap, local)
    readings = rooms[0].readings
    cells.enter_readings(view, readings, 0, 60, 0, HALF)
    cells.share_again(view, readings, 0, 60, HALF)
    again = zeros(CellCounts, 1)
    cells.make_again(rooms, records(CellCounts, again), HALF)
    for name in COUNTS:
        np.testing.assert_array_equal(again[name], counts[name])
    for k in range(60):
        cells.enter_passes(view, readings[k], HALF, -1)
        if readings[k].range_m <= REACH_M:
            cells.lay_arc(view, readings[k], HALF)
            cells.enter_hits(view, readings[k], -1)
    assert not any(counts[name].any() for name in COUNTS)


def test_readings_that_are_carried_over_keep_their_shares() -> None:
    array = zeros(KeptReading, 60)
    array[...] = array_of(some(60))
    array["shares"][:, 0] = 100  # the whole echo at the first place
    cells.enter_readings(records(CellCounts, zeros(CellCounts, 1))[0], records(KeptReading, array), 0, 60, 40, HALF)
    is_echo = array["range_m"] <= REACH_M
    assert (array["shares"][:40] == (100, 0, 0)).all()
    assert (array["shares"][40:][is_echo[40:]] != (100, 0, 0)).any(axis=1).all()


def test_a_bound_of_strength_and_the_hits_of_blocks() -> None:
    counts = zeros(CellCounts, 1)
    view = records(CellCounts, counts)[0]
    cells.enter_readings(view, some(100), 0, 100, 0, HALF)
    every = counts["all_hits"][0]
    blocks = every.reshape(CELLS // BLOCK, BLOCK, CELLS // BLOCK, BLOCK).sum(axis=(1, 3))
    np.testing.assert_array_equal(counts["block_hits"][0], blocks)
    rows, columns = every.nonzero()
    strengths = [
        (cells.strength_of(view, i, j), cells.greatest_strength(view, i, j))
        for i, j in zip(rows, columns, strict=True)
    ]
    assert all(strength <= most + 1e-12 for strength, most in strengths)
    assert sum(strength > 0.0 for strength, _ in strengths) > 20
    cells.clear_cells(view, 0, CELLS // BLOCK)
    assert not any(counts[name].any() for name in (*COUNTS, "block_hits"))


def test_a_place_outside_the_map_has_no_cell() -> None:
    assert cells.cell_of(0.0) == CELLS // 2
    assert cells.cell_of(-0.5 * CELLS * CELL_M - 1.0) == -1
    assert cells.cell_of(0.5 * CELLS * CELL_M) == -1


def test_echoes_of_several_directions_speak_for_a_cell_more_than_many_of_one() -> None:
    counts = zeros(CellCounts, 1)
    view = records(CellCounts, counts)[0]
    for b, at in ((0, 100), (1, 100), (2, 100), (0, 200)):
        counts["hits"][0, b, at, at] += 3 * WHOLE if at == 200 else WHOLE
        counts["all_hits"][0, at, at] += 3 * WHOLE if at == 200 else WHOLE
    assert cells.strength_of(view, 100, 100) > 2.0 * cells.strength_of(view, 200, 200) > 0.0
    assert cells.strength_of(view, 300, 300) == 0.0
