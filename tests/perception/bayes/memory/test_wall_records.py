"""Capacities of the wall map."""

from __future__ import annotations

from perception.bayes.memory.wall_records import SPANS_MAX, WALL_BIN_M, WALL_BINS, WallMap
from tests.perception.bayes.random_tracks import new_memory


def test_a_wall_may_be_eleven_metres_long_and_has_bins_for_its_openings() -> None:
    assert WALL_BINS * WALL_BIN_M > 11.0
    assert WALL_BINS > 4 * SPANS_MAX


def test_a_cleared_memory_has_no_walls_and_no_corners() -> None:
    room = new_memory().s[0].room
    assert all(room.walls[k].weight == 0.0 for k in range(WallMap.DTYPE["walls"].shape[0]))
    assert all(room.corners[k].is_used == 0 for k in range(WallMap.DTYPE["corners"].shape[0]))
