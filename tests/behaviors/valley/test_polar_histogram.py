"""The polar histogram against discs that are driven along every sector, and its thresholds in metres."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from behaviors.valley.polar_histogram import (
    SECTORS,
    Cells,
    Sectors,
    blocked_sectors,
    cells_near,
    crossed,
    masked_by_turning,
    room_m,
)
from config.behaviors import FollowValleyConfig
from runtime.support.kernel_cache import compiled_signatures
from tests import naive_valley
from tests.behaviors.valley.windows import at

ALL_FREE = bytes(SECTORS)
CONFIG = FollowValleyConfig(block_m=1.0, free_m=1.3, occupied_probability=0.6, sure_probability=0.8)


def cells(*places: tuple[float, float], certainties: Sequence[float] = ()) -> Cells:
    x, y = np.array(places, dtype=np.float64).reshape(-1, 2).T.copy()
    return Cells(x, y, np.hypot(x, y), np.array([*certainties] or np.ones(len(x))))


def one_crossed(found: Cells, radius_m: float, way_m: float) -> Sectors:
    (sectors,) = crossed(found, [radius_m], [way_m])
    return np.asarray(sectors)


def blocked_within(found: Cells, before: bytes, target_m: float = 9.0) -> bytes:
    return blocked_sectors(found, before, (0.5, 0.6, 0.45), target_m, CONFIG)[0].tobytes()


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.boundslong
def test_a_sector_is_crossed_where_the_disc_would_touch_a_cell(seed: int) -> None:
    rng = np.random.default_rng(seed)
    places = [(float(x), float(y)) for x, y in rng.uniform(-2.5, 2.5, (seed, 2))]
    certainties = [float(share) for share in rng.uniform(0.1, 1.0, seed)]
    radii_m, ways_m = rng.uniform(0.2, 0.8, 3).tolist(), rng.uniform(0.3, 2.0, 3).tolist()
    known, in_part = cells(*places, certainties=certainties), seed % 2 == 0
    naive = [(x, y, certainty) for (x, y), certainty in zip(places, certainties, strict=True)]
    for found, radius_m, way_m in zip(crossed(known, radii_m, ways_m, in_part=in_part), radii_m, ways_m, strict=True):
        expected = naive_valley.touched(naive, radius_m, way_m, in_part=in_part)
        differ = [
            sector
            for sector, (flag, touches) in enumerate(zip(found.tolist(), expected, strict=True))
            if touches is not None and flag != touches
        ]
        assert differ == []
        assert expected.count(None) < 3


def test_a_cell_inside_the_disc_leaves_the_ways_away_from_it() -> None:
    found = one_crossed(cells((0.3, 0.0)), 0.5, 1.0)
    free_deg = np.flatnonzero(~found) * 5
    assert (free_deg.min(), free_deg.max()) == (90, 270)


def test_nothing_near_blocks_nothing() -> None:
    assert not one_crossed(cells(), 0.5, 1.0).any()
    assert not one_crossed(cells((3.0, 0.0)), 0.5, 1.0).any()


def test_a_sure_cell_blocks_within_one_way_and_frees_beyond_another() -> None:
    def ahead(distance_m: float, before: bytes, certainty: float = 1.0) -> bytes:
        return blocked_within(cells((distance_m, 0.0), certainties=[certainty]), before)

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


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.boundslong
def test_cells_are_those_of_the_grid_and_the_fresh_echoes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    place = rng.uniform(-7.5, 7.5, 2)  # some are outside the grid
    percept = at(*place.tolist(), echoes=[(float(ex), float(ey)) for ex, ey in rng.uniform(-8.0, 8.0, (60, 2))])
    assert percept.occupancy is not None
    percept.occupancy.occupied[:] = rng.uniform(0.5, 0.9, percept.occupancy.occupied.shape)
    heard = (0.4, -0.3, 0.5 * (seed % 3))
    x, y = place.tolist()
    found = cells_near(percept, x, y, 1.5, CONFIG, only_heard=heard)
    rows = np.column_stack([found.dx, found.dy, found.certainties])
    expected = naive_valley.cells_near(percept, x, y, 1.5, 0.6, 0.8, only_heard=heard)
    np.testing.assert_allclose(rows, np.array(expected).reshape(-1, 3), atol=1e-6)
    np.testing.assert_allclose(found.distances, np.hypot(found.dx, found.dy))


def test_without_a_grid_there_are_echoes_only() -> None:
    percept = replace(at(0.0, 0.0, echoes=[(0.5, 0.5), (3.0, 0.0)]), occupancy=None)
    found = cells_near(percept, 0.0, 0.0, 1.5, CONFIG)
    assert (found.dx.tolist(), found.dy.tolist(), found.certainties.tolist()) == ([0.5], [0.5], [1.0])


def test_no_layout_of_an_array_compiles_a_kernel_again() -> None:
    """In a cycle that would take a second."""
    walls = [(1.0, -1.0, 1.0, 1.0)]
    first = cells_near(at(0.0, 0.0, walls=walls), 0.0, 0.0, 1.5, CONFIG)
    before = compiled_signatures()
    percept = at(0.0, 0.0, walls=walls)
    assert percept.occupancy is not None
    grid = replace(percept.occupancy, occupied=np.asfortranarray(percept.occupancy.occupied))
    echoes = np.zeros((4, 2, 2))[::2, :, 0]
    for of in (grid.occupied, echoes):
        of.flags.writeable = False
    found = cells_near(replace(percept, occupancy=grid, obstacles=echoes), 0, 0, 1.5, CONFIG)
    crossed(found, [1, 1], [1, 1])
    assert compiled_signatures() == before
    assert len(found.dx) == len(first.dx) + 2


def test_a_place_outside_the_grid_has_echoes_only() -> None:
    percept = at(0.0, 0.0, walls=[(1.0, -1.0, 1.0, 1.0)], echoes=[(50.5, 0.0), (float("nan"), 0.0)])
    for x in (-50.0, 50.0):
        assert len(cells_near(percept, x, 0.0, 1.5, CONFIG).dx) == (x > 0.0)


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
