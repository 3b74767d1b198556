"""The directed grid against its oracle, and the properties for which it is built."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.messages import Firing, Floats, Pose
from perception.mapping.grid import directed
from perception.mapping.grid.cell_evidence import BASE, FADING_PLACES, HIT, NAT, SURE, UNDIRECTED, evidence_now
from perception.mapping.grid.directed import DirectedGrid, arc_cells_max
from perception.mapping.grid.window import Ring, Window, placed
from perception.snapshot import put_back, snapshot_of
from tests.naive_grid import NaiveGrid

MOUNTS = np.array([[0.2, 0.0, 0.0], [0.1, 0.17, 0.5], [-0.1, 0.17, 1.2], [-0.2, 0.0, math.pi]])
RING = Ring(MOUNTS, math.radians(12.0), 0.03048 / math.sqrt(12.0), 5.0)
UNKNOWN = np.full(len(MOUNTS), math.nan)


def make_grid(cells: int = 128) -> DirectedGrid:
    return DirectedGrid(Window(cells, 0.1), RING)


def firing(ranges: list[float], x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> Firing:
    return Firing(0.0, Pose(x, y, yaw), yaw, np.array(ranges))


def evidence(grid: DirectedGrid, place: int, x: float, y: float) -> Floats:
    """Return the nine evidences of the cell at a point, nat; places are numbered from 1."""
    mask = grid.window.cells - 1
    cell = grid.cells[math.floor(y / 0.1) & mask, math.floor(x / 0.1) & mask]
    return np.array([evidence_now(kept, place + 1) for kept in cell]) / NAT


def test_every_cell_is_as_in_the_oracle() -> None:
    rng = np.random.default_rng(1)
    grid, oracle = make_grid(), NaiveGrid(RING.half_angle, RING.rounding_m, 0.1)
    x = y = yaw = 0.0
    for place in range(1, 12):
        x, y, yaw = x + rng.normal(0.0, 0.1), y + rng.normal(0.0, 0.1), yaw + rng.normal(0.0, 0.5)
        for _ in range(2):
            ranges = rng.choice([rng.uniform(0.3, 3.0), rng.uniform(0.3, 3.0), math.inf, math.nan], 4)
            bearings = np.where(rng.random(4) < 0.2, rng.uniform(-0.2, 0.2, 4), math.nan)
            fired = Firing(0.0, Pose(x, y, yaw), yaw, ranges)
            mirrors = grid.mirrors
            grid.observe(fired, bearings, place - 1, 2.0)
            sensors = [(sx, sy, axis) for sx, sy, axis in placed(fired, RING)]
            oracle.enter(sensors, ranges, bearings, place, 2.0, mirrors)
    cx, cy = grid.window.corner.tolist()
    seen = 0
    for iy in range(cy, cy + 128):
        for ix in range(cx, cx + 128):
            cell = grid.cells[iy & 127, ix & 127]
            if (ix, iy) not in oracle.cells:
                assert not cell.any()
                continue
            seen += 1
            ours = [evidence_now(kept, 11) for kept in cell]
            np.testing.assert_allclose(ours, [each.now(11) for each in oracle.cells[ix, iy]], atol=4)
    assert seen > 300


def drive_among_mirrors(grid: DirectedGrid, places: range) -> None:
    """Pass a wall that answers from the front and is passed by slanting beams, and one that answers all."""
    for place in places:
        x = 0.05 * place
        front = firing([1.3, math.nan, math.nan, 1.1], x, 0.0, math.pi / 2.0)
        slanting = firing([math.inf, 1.9, math.nan, math.nan], x - 1.6, 0.1, math.pi / 4.0)
        for fired in (front, slanting):
            grid.observe(fired, UNKNOWN, place, 4.0)


def test_cells_that_may_be_sure_are_known_also_after_the_memory_was_overwritten() -> None:
    grid, other = make_grid(), make_grid()
    drive_among_mirrors(grid, range(1, 200))  # the window moves on, and cells leave it
    sure = (grid.cells[:, :, :UNDIRECTED, BASE] + grid.cells[:, :, :UNDIRECTED, HIT] >= SURE).any(axis=2)
    assert 20 < sure.sum() <= grid._maybe_sure.sum() < 400
    assert not (sure & ~grid._maybe_sure).any()
    put_back(other, snapshot_of(grid))
    other.window.corner[:], other.window.placed = grid.window.corner, True
    other.drop_caches()
    before = grid._answers.tolist()
    for each in (grid, other):
        each.observe(firing([math.inf, *UNKNOWN[1:]], 7.5, 0.1, math.pi / 4.0), UNKNOWN, 200, 4.0)
    assert before != grid._answers.tolist() == other._answers.tolist()
    np.testing.assert_array_equal(grid.cells, other.cells)


@pytest.mark.covered
def test_order_of_the_sensors_in_a_firing_makes_no_difference() -> None:
    rng = np.random.default_rng(2)
    order = np.array([2, 0, 3, 1])
    ours, other = make_grid(), DirectedGrid(Window(128, 0.1), Ring(MOUNTS[order], RING.half_angle, 0.0, 5.0))
    ours._rounding_m = 0.0
    for place in range(1, 30):
        fired = firing(rng.choice([0.8, 1.4, 2.0, math.inf], 4).tolist(), 0.05 * place, 0.0, 0.1 * place)
        ours.observe(fired, UNKNOWN, place, 3.0)
        other.observe(Firing(0.0, fired.pose, fired.ring_yaw, fired.ranges_m[order]), UNKNOWN, place, 3.0)
    np.testing.assert_array_equal(ours.cells, other.cells)
    assert ours.mirrors == other.mirrors


def test_repeats_from_one_place_do_not_multiply() -> None:
    once, often = make_grid(), make_grid()
    for grid, count in ((once, 1), (often, 50)):
        for _ in range(count):
            grid.observe(firing([1.0, 2.0, math.inf, math.nan]), UNKNOWN, 7, 3.0)
    np.testing.assert_array_equal(once.cells, often.cells)


def test_an_echo_from_further_places_is_further_evidence() -> None:
    grid = make_grid()
    peaks = []
    for place in range(1, 8):
        grid.observe(firing([2.0 - 0.02 * place, math.nan, math.nan, math.nan], 0.02 * place), UNKNOWN, place, 3.0)
        peaks.append(max(evidence(grid, place, 2.15 + 0.1 * k, 0.0)[0] for k in range(2)))
    assert peaks == sorted(peaks)
    assert peaks[-1] > 3.0 * peaks[0] > 0.0


def test_an_echo_whose_bearing_is_known_marks_its_contact_only() -> None:
    grid = make_grid()
    grid.observe(firing([2.0, math.nan, math.nan, math.nan]), np.array([0.1, math.nan, math.nan, math.nan]), 1, 3.0)
    hit = np.argwhere(grid.cells[..., HIT] > 0)
    assert {tuple(row) for row in hit[:, :2].tolist()} == {
        (math.floor(2.0 * math.sin(0.1) / 0.1), math.floor((0.2 + 2.0 * math.cos(0.1)) / 0.1))
    }
    assert evidence(grid, 1, 0.2 + 2.0 * math.cos(0.1), 2.0 * math.sin(0.1))[0] == pytest.approx(3.0)


def test_silence_counts_in_its_own_direction_only_and_to_the_learnt_range() -> None:
    grid = make_grid()
    for place in range(1, 5):
        grid.observe(firing([2.0, math.nan, math.nan, math.nan], 0.01 * place), UNKNOWN, place, 3.0)
    heard = evidence(grid, 4, 2.2, 0.05)
    for place in range(5, 15):  # from the side, looking in +y, nothing answers
        side = firing([math.inf, math.nan, math.nan, math.nan], 2.2, -1.5, math.pi / 2.0)
        grid.observe(side, UNKNOWN, place, 2.0)
    after = evidence(grid, 14, 2.2, 0.05)
    assert after[0] == pytest.approx(heard[0], abs=0.02)
    assert after[2] < -2.5
    assert after[UNDIRECTED] < 0.0 < heard[UNDIRECTED]
    assert not evidence(grid, 14, 2.2, 0.75).any(), "beyond the learnt range nothing is known"


def test_evidence_fades_with_the_way() -> None:
    grid = make_grid()
    grid.observe(firing([math.inf] * 4), UNKNOWN, 1, 2.0)
    assert evidence(grid, 1, 1.2, 0.0)[0] == pytest.approx(-directed.SILENT_NAT / NAT, rel=0.1)
    later = 1 + 100 * FADING_PLACES
    assert evidence(grid, later, 1.2, 0.0)[0] == pytest.approx(evidence(grid, 1, 1.2, 0.0)[0] + 100 / NAT)


def test_a_place_of_mirrors_is_recognised() -> None:
    """A wall that is heard from the front is passed by slanting beams if it is a mirror, and else answers them."""
    for slanting, mirrors in ((math.inf, 1.0), (1.6, 0.0)):
        grid = make_grid()
        for place in range(1, 60, 2):
            x = 0.02 * place
            grid.observe(firing([1.3, math.nan, math.nan, math.nan], x, 0.0, math.pi / 2.0), UNKNOWN, place, 4.0)
            beam = firing([slanting, math.nan, math.nan, math.nan], x - 1.6, 0.1, math.pi / 4.0)
            grid.observe(beam, UNKNOWN, place + 1, 4.0)
        assert grid.mirrors == mirrors


def test_probability_is_asked_from_any_direction_or_from_a_place() -> None:
    grid = make_grid()
    for place in range(1, 9):
        grid.observe(firing([2.0, math.nan, math.nan, math.nan], 0.01 * place), UNKNOWN, place, 3.0)
        grid._answers[:] = 0.0, 100.0
        grid.observe(firing([math.inf, *UNKNOWN[1:]], 2.2, -1.5, math.pi / 2.0), UNKNOWN, place, 2.0)
    grid._answers[:] = 0.0, 100.0
    assert grid.mirrors == 1.0
    row, column = 0 - int(grid.window.corner[1]), 22 - int(grid.window.corner[0])
    assert grid.probability(None)[row, column] > 0.7
    assert grid.probability((0.0, 0.0))[row, column] > 0.7
    assert grid.probability((2.25, -1.5))[row, column] < 0.1
    assert grid.probability(None)[100, 2] == 0.5


@pytest.mark.covered
def test_an_arc_never_needs_more_room_than_it_has() -> None:
    wide = Ring(MOUNTS[:1], math.radians(60.0), 0.0, 40.0)
    grid = DirectedGrid(Window(256, 0.05), wide)
    for r in (0.2, 3.0, 6.0, 8.0, 30.0):
        for yaw in (0.0, 0.8):
            grid.observe(Firing(0.0, Pose(0.02, 0.01, yaw), yaw, np.array([r])), UNKNOWN[:1], 1, 3.0)
    assert np.count_nonzero(grid._shares) < arc_cells_max(grid.window, wide)


def test_clear_forgets_everything() -> None:
    grid = make_grid()
    grid.observe(firing([1.0, 2.0, math.inf, 0.5]), UNKNOWN, 3, 3.0)
    grid.clear()
    assert not grid.cells.any()
    assert not grid.window.placed
