"""The readings of a local map, and when another map begins."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.messages import Firing, Pose
from perception.map_moves import MapMoves
from perception.mapping.surfaces.local_map import LocalMapSearch
from perception.mapping.surfaces.parameters import LEFT_M, LEFT_MAX_M, READINGS_MAX

pytestmark = pytest.mark.compiled
MOUNTS = np.array([[0.1, 0.0, 0.0], [0.0, 0.1, 1.5]])


def search() -> LocalMapSearch:
    return LocalMapSearch(math.radians(12.0), 5.0, np.array([0.3]))


def fire(at: LocalMapSearch, x: float, y: float = 0.0, ranges: tuple[float, ...] = (2.0, math.inf)) -> None:
    at.keep(Firing(0.0, Pose(x, y, 0.0), 0.0, np.array(ranges)), MOUNTS)


def test_another_map_begins_with_the_readings_from_around_its_centre() -> None:
    ours = search()
    for k in range(300):
        fire(ours, 0.05 * k)
    assert not ours.has_left(LEFT_M - 0.1, 0.0)
    assert not ours.has_left(LEFT_M + 0.1, 0.0)  # it is searched first
    assert ours.has_left(LEFT_MAX_M + 0.1, 0.0)
    before = int(ours.room[0].count)
    ours.begin_at(15.0, 0.0)
    kept = ours.local["readings"][0, : int(ours.room[0].count)]
    assert 0 < len(kept) < before
    assert np.abs(kept["x"]).max() < 16.0
    assert ours.centre == (15.0, 0.0)
    assert ours.is_due
    ours.finish()
    assert ours.room[0].entered == len(kept)


def test_a_full_map_takes_no_more_and_another_one_begins() -> None:
    ours = search()
    for k in range(READINGS_MAX):
        fire(ours, 0.03 * (k % 100), 0.03 * (k // 100))
    assert ours.room[0].count == READINGS_MAX
    assert not ours.has_left(*ours.centre)
    while ours.is_due:
        ours.refine()
    assert ours.has_left(*ours.centre)
    ours.clear()
    assert not ours.is_due


def test_readings_move_with_their_maps_of_the_way_and_the_cells_are_made_anew() -> None:
    ours = search()
    turn, to = 0.5 * math.pi, (0.3, -0.2)
    for k in range(60):
        ours.local["submap"] = k // 30
        fire(ours, 0.05 * k)
    ours.finish()
    motions = np.array([[*to, turn], [0.0, 0.0, 0.0]])
    ours.move(MapMoves(motions, np.zeros((2, 2))))
    readings = ours.local["readings"][0, : int(ours.room[0].count)]
    first, second = (readings[readings["submap"] == k] for k in (0, 1))
    x, y = ours.centre
    along = first["y"][::2] + y - to[1]
    np.testing.assert_allclose(first["x"][::2] + x, to[0], atol=1e-9)
    assert along.min() == pytest.approx(0.1)
    assert np.ptp(along) == pytest.approx(0.05 * 29, abs=0.05)
    np.testing.assert_allclose(first["axis"][::2], turn)
    np.testing.assert_allclose(second["y"][::2] + y, 0.0, atol=1e-9)
    assert ours.submaps(np.array([0.3, 2.2]), np.array([0.7, 0.0])).tolist() == [0, 1]
    assert ours.is_due
    ours.finish()
    assert ours.room[0].entered == len(readings)
    assert ours.contradiction() is None
