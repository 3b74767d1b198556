"""Readings are found where they were made, and what is unknown says nothing."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.kernel import Floats
from perception.localization.submaps.local_grid import SUBMAP_CELLS, answers_of
from perception.localization.submaps.map_match import BEAM_CELLS, Match, best_match, fit_of
from tests.perception.localization.submaps.test_local_grid import BEAM, grid_of

USUAL = np.array([BEAM, -0.7])


def room_readings(x: float = 0.0, y: float = 0.0, theta: float = 0.0) -> Floats:
    """Readings of a room of 3.4 × 2.6 m about the origin, from a few places, in the frame of a pose in it."""
    rows = []
    for at_x, at_y in ((0.0, 0.0), (0.4, 0.1), (-0.5, -0.2), (0.3, -0.4), (-0.2, 0.4)):
        for axis in np.deg2rad(np.arange(0.0, 360.0, 15.0)):
            rays = axis + BEAM * np.linspace(-1.0, 1.0, 25)
            c, s = np.cos(rays), np.sin(rays)
            to_x = np.where(c > 0, 1.7 - at_x, 1.7 + at_x) / np.maximum(np.abs(c), 1e-9)
            to_y = np.where(s > 0, 1.3 - at_y, 1.3 + at_y) / np.maximum(np.abs(s), 1e-9)
            rows.append((at_x, at_y, axis, float(np.minimum(to_x, to_y).min())))
    found = np.array(rows)
    dx, dy, c, s = found[:, 0] - x, found[:, 1] - y, math.cos(theta), math.sin(theta)
    found[:, 0], found[:, 1], found[:, 2] = c * dx + s * dy, c * dy - s * dx, found[:, 2] - theta
    return found


def room_map() -> Floats:
    """Return how the cells of a map of the room answer."""
    hits, passes = grid_of(room_readings())
    maps = np.empty((2, SUBMAP_CELLS, SUBMAP_CELLS))
    answers_of(hits, passes, maps[0], maps[1])
    return maps


@pytest.mark.compiled
@pytest.mark.parametrize("moved", [(0.0, 0.0, 0.0), (0.21, -0.13, 0.07), (-0.24, 0.2, -0.06)])
def test_readings_are_found_where_they_were_made(moved: tuple[float, float, float]) -> None:
    *_, match = best_match(
        room_readings(*moved), room_map(), USUAL, np.zeros(3), np.array([0.3, 0.3, 0.1]), np.eye(3)
    )
    assert isinstance(match, Match)
    np.testing.assert_allclose(match.pose, moved, atol=0.04)
    assert match.known > 50
    assert np.all(np.linalg.eigvalsh(match.information) > 0.0)


def test_where_no_range_came_a_reading_says_nothing() -> None:
    maps, fit = np.zeros((2, SUBMAP_CELLS, SUBMAP_CELLS)), np.empty(2)
    maps[0] = 0.03
    readings = room_readings()
    fit_of(readings, 3, 1, np.zeros(3), USUAL, maps, np.empty(BEAM_CELLS), fit)
    assert fit.tolist() == [0.0, 0.0]


def test_beyond_the_map_nothing_is_read() -> None:
    fit = np.empty(2)
    fit_of(room_readings(), 4, 1, np.array([30.0, -30.0, 1.0]), USUAL, room_free(), np.empty(BEAM_CELLS), fit)
    assert fit.tolist() == [0.0, 0.0]


def room_free() -> Floats:
    """Return a map that is known everywhere, and free."""
    maps = np.ones((2, SUBMAP_CELLS, SUBMAP_CELLS))
    maps[0] = 0.0
    return maps


def test_an_echo_where_all_is_free_is_an_outlier() -> None:
    fit = np.empty(2)
    fit_of(room_readings(), 1, 1, np.zeros(3), USUAL, room_free(), np.empty(BEAM_CELLS), fit)
    assert fit[1] == pytest.approx(1.0)
    assert fit[0] == pytest.approx(math.log(0.1 / 4.9) + 0.7)
