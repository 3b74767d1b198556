"""The polar histogram against discs that are driven along every sector, and its thresholds in metres."""

from __future__ import annotations

import math

import numpy as np
import pytest

from behaviors.valley.polar_histogram import (
    ALL_FREE,
    SECTOR_RAD,
    SECTORS,
    Cells,
    Sectors,
    blocked_sectors,
    cells_near,
    crossed,
    heard_at,
    masked_by_turning,
    room_m,
)
from config.behaviors import FollowValleyConfig
from tests.behaviors.valley.windows import at

CONFIG = FollowValleyConfig(block_m=1.0, free_m=1.3, occupied_probability=0.6, sure_probability=0.8)


def cells(*places: tuple[float, float], certainty: float = 1.0) -> Cells:
    x, y = np.array(places, dtype=np.float64).reshape(-1, 2).T
    return Cells(x, y, np.hypot(x, y), np.full(len(x), certainty))


def one_crossed(found: Cells, radius_m: float, way_m: float) -> Sectors:
    (sectors,) = crossed(found, np.array([radius_m]), np.array([way_m]))
    return np.asarray(sectors)


def blocked_within(found: Cells, before: bytes, target_m: float = 9.0) -> bytes:
    return blocked_sectors(found, before, (0.5, 0.6, 0.45), target_m, CONFIG)[0].tobytes()


def gap_m(x: float, y: float, sector: int, way_m: float) -> float:
    """Return how near a point's centre comes that drives along a sector's middle."""
    ux, uy = math.cos(sector * SECTOR_RAD), math.sin(sector * SECTOR_RAD)
    along = min(way_m, max(0.0, x * ux + y * uy))
    return math.hypot(x - along * ux, y - along * uy)


@pytest.mark.parametrize("seed", range(20))
def test_a_sector_is_crossed_where_the_disc_would_touch_a_cell(seed: int) -> None:
    rng = np.random.default_rng(seed)
    radius_m, way_m = float(rng.uniform(0.2, 0.8)), float(rng.uniform(0.3, 2.0))
    places = [(float(x), float(y)) for x, y in rng.uniform(-2.5, 2.5, (seed + 1, 2)) if math.hypot(x, y) > radius_m]
    found = one_crossed(cells(*places), radius_m, way_m)
    for sector in range(SECTORS):
        nearest = min((gap_m(x, y, sector, way_m) for x, y in places), default=math.inf)
        if abs(nearest - radius_m) > 1e-6:
            assert found[sector] == (nearest < radius_m), (sector, nearest)


def test_a_cell_inside_the_disc_leaves_the_ways_away_from_it() -> None:
    found = one_crossed(cells((0.3, 0.0)), 0.5, 1.0)
    free_deg = np.flatnonzero(~found) * 5
    assert (free_deg.min(), free_deg.max()) == (90, 270)


def test_nothing_near_blocks_nothing() -> None:
    assert not one_crossed(cells(), 0.5, 1.0).any()
    assert not one_crossed(cells((3.0, 0.0)), 0.5, 1.0).any()


def test_a_sure_cell_blocks_within_one_way_and_frees_beyond_another() -> None:
    def ahead(distance_m: float, before: bytes, certainty: float = 1.0) -> bytes:
        return blocked_within(cells((distance_m, 0.0), certainty=certainty), before)

    assert ahead(1.49, ALL_FREE)[0] == 1
    assert ahead(1.51, ALL_FREE)[0] == 0
    before = ahead(1.49, ALL_FREE)
    assert ahead(1.79, before)[0] == 1, "it does not flicker"
    assert ahead(1.81, before)[0] == 0
    assert ahead(1.2, ALL_FREE, certainty=0.5)[0] == 0, "one that is half sure blocks half the way"
    assert ahead(0.9, ALL_FREE, certainty=0.5)[0] == 1
    assert blocked_within(cells((1.2, 0.0)), ALL_FREE, 0.6)[0] == 0, "it lies behind the target"


def test_a_sector_that_passes_nearer_than_is_comfortable_is_near() -> None:
    blocked, near, _ = blocked_sectors(cells((0.5, 0.55)), ALL_FREE, (0.5, 0.6, 0.45), 9.0, CONFIG)
    assert near[0]
    assert not blocked[0]


def test_a_sector_with_less_room_than_is_wanted_is_blocked_and_closed_only_if_the_robot_cannot_just_pass() -> None:
    for y, is_closed in ((0.47, False), (0.44, True)):
        blocked, near, closed = blocked_sectors(cells((0.5, y)), ALL_FREE, (0.5, 0.6, 0.45), 9.0, CONFIG)
        assert (blocked[0], near[0], closed[0]) == (True, True, is_closed)


def test_cells_are_those_of_the_grid_and_the_fresh_echoes() -> None:
    percept = at(0.13, -0.21, walls=[(1.0, -1.0, 1.0, 1.0), (-5.0, 0.0, -5.0, 1.0)], echoes=[(0.5, 0.5), (3.0, 0.0)])
    assert percept.occupancy is not None
    grid = percept.occupancy
    found = cells_near(percept, 0.13, -0.21, 1.5, CONFIG)
    expected = {(0.37, 0.71)}
    for row, column in np.argwhere(grid.occupied > 0.6).tolist():
        dx, dy = grid.x_m + (column + 0.5) * 0.1 - 0.13, grid.y_m + (row + 0.5) * 0.1 + 0.21
        if math.hypot(dx, dy) < 1.5:
            expected.add((round(dx, 6), round(dy, 6)))
    assert {(round(x, 6), round(y, 6)) for x, y in zip(found.dx, found.dy, strict=True)} == expected
    assert len(expected) > 15
    assert set(found.certainties.tolist()) == {1.0}


def test_a_place_outside_the_grid_has_echoes_only() -> None:
    percept = at(0.0, 0.0, walls=[(1.0, -1.0, 1.0, 1.0)], echoes=[(50.5, 0.0), (float("nan"), 0.0)])
    for x in (-50.0, 50.0):
        assert len(cells_near(percept, x, 0.0, 1.5, CONFIG).dx) == (x > 0.0)


def test_near_a_place_only_what_is_heard_is_left() -> None:
    echoes = [(1.0, 0.1), (-2.0, 0.0)]
    percept = at(0.0, 0.0, walls=[(1.2, -1.0, 1.2, 1.0)], echoes=echoes)
    around = cells_near(percept, 0.0, 0.0, 3.0, CONFIG)
    found = heard_at(around, (1.0, 0.0), 0.5, percept)
    before = list(zip(around.dx.tolist(), around.dy.tolist(), around.certainties.tolist(), strict=True))
    kept = [cell for cell in before if math.dist(cell[:2], (1.0, 0.0)) >= 0.5]
    assert 4 < len(kept) < len(before) - 4
    after = list(zip(found.dx.tolist(), found.dy.tolist(), found.certainties.tolist(), strict=True))
    assert after == [*kept, (1.0, 0.1, 1.0)], "each echo once"
    assert (-2.0, 0.0, 1.0) in kept
    np.testing.assert_allclose(found.distances, np.hypot(found.dx, found.dy))


def test_an_uncertain_cell_counts_in_part() -> None:
    percept = at(0.0, 0.0)
    assert percept.occupancy is not None
    percept.occupancy.occupied[64, 70] = 0.7
    found = cells_near(percept, 0.0, 0.0, 1.0, CONFIG)
    assert found.certainties == pytest.approx([0.5], abs=1e-6)


def test_a_robot_in_a_narrow_place_asks_for_the_room_that_there_is() -> None:
    assert room_m(cells(), 0.4, 0.6) == 0.6
    assert room_m(cells((0.5, 0.0)), 0.4, 0.6) == pytest.approx(0.48)
    assert room_m(cells((0.1, 0.0)), 0.4, 0.6) == 0.4
    walls = [(-2.0, 0.55, 2.0, 0.55), (-2.0, -0.55, 2.0, -0.55)]
    near = cells_near(at(0.0, 0.0, walls=walls), 0.0, 0.0, 2.0, CONFIG)
    assert not one_crossed(near, room_m(near, 0.4, 0.7), 1.0)[[0, 36]].any(), "along the corridor"


def test_what_stands_in_a_turning_circle_masks_its_side() -> None:
    left = masked_by_turning(cells((0.2, 0.6)), 0.0, 0.4, 1.0)
    assert left[18:35].all()
    assert not left[37:72].any()
    assert not left[:14].any()
    right = masked_by_turning(cells((-0.6, 0.2)), math.pi / 2.0, 0.4, 1.0)
    assert (right == np.roll(left, 18)).all(), "it turns with the heading"
