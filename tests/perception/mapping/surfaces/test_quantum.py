"""Quanta of a local map's work: what is kept, how much one of them does, and what a new search leaves of the last."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.mapping.surfaces import quantum
from perception.mapping.surfaces.parameters import REVISITS
from perception.mapping.surfaces.records import CellCounts, LocalMap
from perception.records import records, zeros
from perception.shared_numbers import FAR, SPACING_M

pytestmark = pytest.mark.compiled
HALF = math.radians(12.0)
RADII = np.array([0.3])
MOUNTS = np.array([[0.1, 0.0, 0.0], [0.0, 0.1, 1.5]])


def test_a_sensor_that_has_moved_is_kept() -> None:
    local = zeros(LocalMap, 1)
    rooms = records(LocalMap, local)
    quantum.keep(rooms, MOUNTS, np.array([1.0, 0.0, 0.0]), np.array([2.0, math.inf]), 5.0)
    quantum.keep(rooms, MOUNTS, np.array([1.0 + 0.5 * SPACING_M, 0.0, 0.0]), np.array([2.0, math.inf]), 5.0)
    assert local["count"] == 2
    quantum.keep(rooms, MOUNTS, np.array([1.0 + 1.1 * SPACING_M, 0.0, 0.0]), np.array([math.nan, 1.0]), 5.0)
    assert local["count"] == 3
    readings = local["readings"][0, :3]
    np.testing.assert_allclose(readings["x"], [0.1, 0.0, 1.1 * SPACING_M])
    np.testing.assert_allclose(readings["range_m"], [2.0, FAR, 1.0])
    assert local["centre_x"] == 1.0


def test_a_quantum_does_so_much_and_a_search_ends() -> None:
    """A wall beside the way is found, and a search that begins holds nothing of the one before."""
    local, counts = zeros(LocalMap, 1), zeros(CellCounts, 1)
    rooms, every = records(LocalMap, local), records(CellCounts, counts)
    mounts = np.array([[0.0, 0.0, 0.5 * math.pi]])
    for n in range(quantum.SEARCH_READINGS_MIN):
        quantum.keep(rooms, mounts, np.array([0.03 * n, 0.0, 0.0]), np.array([1.0]), 5.0)
    done = []
    for _ in range(10_000):
        if not quantum.is_due(rooms):
            break
        before = {name: int(local[name][0]) for name in ("entered", "owed", "at", "phase")}
        done.append(quantum.do_quantum(rooms, every, HALF, RADII))
        entered = int(local["entered"][0]) - before["entered"]
        assert entered <= quantum.ENTERED
        assert before["owed"] - int(local["owed"][0]) + entered * REVISITS <= quantum.SHARED
        if before["phase"] == local["phase"][0] == quantum.LOCATE:
            assert local["at"][0] - before["at"] <= quantum.LOCATED
    assert not quantum.is_due(rooms)
    assert done.count(True) == 1
    assert local["piece_count"] == 1
    assert local["pieces"]["echoes"][0, 0] > 0.8 * quantum.SEARCH_READINGS_MIN
    assert local["heard"][0] > 0.0
    local["passed"] = 1.0
    quantum.do_quantum(rooms, every, HALF, RADII)
    assert local["phase"] == quantum.CAPTURE
    for name in ("cells", "pieces", "points", "chains"):
        assert not local[name].tobytes().strip(b"\0"), name
    assert local["heard"][0] == local["passed"][0] == 0.0
