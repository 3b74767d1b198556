"""A map of a few metres of way: echoes gather on a surface, and a map added to another one lies as it should."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.kernel import Floats
from perception.localization.submaps.local_grid import (
    HALF_CELLS,
    SHARING_ROUNDS,
    SUBMAP_CELL_M,
    SUBMAP_CELLS,
    add_map,
    answers_of,
    enter_passes,
    share_echoes,
)

BEAM = math.radians(12.0)


def wall_readings(distance: float = 1.5) -> Floats:
    """Readings from along the y axis of a wall at x = `distance`, from its point in the beam that is nearest."""
    rows = [
        (0.0, 0.1 * k, angle, distance / math.cos(max(0.0, abs(angle) - BEAM)))
        for k in range(-10, 11)
        for angle in np.deg2rad(np.arange(-30.0, 31.0, 15.0))
    ]
    return np.array(rows)


def grid_of(readings: Floats) -> tuple[Floats, Floats]:
    """Return hits and passes of readings."""
    hits, passes, shared = (
        np.zeros((SUBMAP_CELLS, SUBMAP_CELLS)),
        np.zeros((SUBMAP_CELLS, SUBMAP_CELLS)),
        np.zeros((SUBMAP_CELLS, SUBMAP_CELLS)),
    )
    enter_passes(readings, 0, len(readings), BEAM, passes)
    for _ in range(SHARING_ROUNDS):
        share_echoes(readings, len(readings), BEAM, passes, hits, shared)
    return hits, passes


@pytest.mark.compiled
def test_echoes_gather_on_the_wall() -> None:
    hits, _ = grid_of(wall_readings())
    at = HALF_CELLS + math.floor(1.5 / SUBMAP_CELL_M)
    assert hits[at - 2 : at + 1].sum() > 0.9 * hits.sum()  # an arc lies before the wall


def test_a_range_passes_the_area_of_its_cone() -> None:
    """The oracle: every cell of the cone once, by its angle."""
    passes, reading = np.zeros((SUBMAP_CELLS, SUBMAP_CELLS)), np.array([[0.02, -0.03, 0.4, 3.0]])
    enter_passes(reading, 0, 1, BEAM, passes)
    i, j = np.meshgrid(np.arange(SUBMAP_CELLS), np.arange(SUBMAP_CELLS), indexing="ij")
    x, y = (i - HALF_CELLS + 0.5) * SUBMAP_CELL_M - 0.02, (j - HALF_CELLS + 0.5) * SUBMAP_CELL_M + 0.03
    off = (np.arctan2(y, x) - 0.4) / BEAM
    expected = np.where((np.abs(off) <= 1.0) & (np.hypot(x, y) < 2.9), 1.0 - 0.5 * off**2, 0.0)
    assert passes.sum() == pytest.approx(expected.sum(), rel=0.1)
    assert np.abs(passes - expected)[expected > 0.7].mean() < 0.25


def test_silence_passes_a_part_and_hits_nothing() -> None:
    hits, passes = grid_of(np.array([[0.0, 0.0, 0.0, math.inf]]))
    assert hits.sum() == 0.0
    assert passes[HALF_CELLS + 20].sum() > 0.0
    assert passes[HALF_CELLS + 30].sum() == 0.0


def test_a_map_added_at_a_quarter_turn_is_turned() -> None:
    rng = np.random.default_rng(3)
    hits, passes = rng.random((SUBMAP_CELLS, SUBMAP_CELLS)), rng.random((SUBMAP_CELLS, SUBMAP_CELLS))
    to_hits, to_passes = np.zeros((SUBMAP_CELLS, SUBMAP_CELLS)), np.zeros((SUBMAP_CELLS, SUBMAP_CELLS))
    add_map(hits, passes, 0.0, 0.0, math.pi / 2.0, to_hits, to_passes)
    inside = slice(2, -2)
    np.testing.assert_allclose(to_hits[inside, inside], np.rot90(hits, 1)[inside, inside], atol=1e-9)
    np.testing.assert_allclose(to_passes[inside, inside], np.rot90(passes, 1)[inside, inside], atol=1e-9)


def test_what_was_not_looked_at_is_unknown() -> None:
    answers, known = np.empty((SUBMAP_CELLS, SUBMAP_CELLS)), np.empty((SUBMAP_CELLS, SUBMAP_CELLS))
    answers_of(np.zeros((SUBMAP_CELLS, SUBMAP_CELLS)), np.zeros((SUBMAP_CELLS, SUBMAP_CELLS)), answers, known)
    assert np.all(known == 0.0)
    assert answers.max() == pytest.approx(0.03)
