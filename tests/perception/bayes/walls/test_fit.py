"""The fit of a wall to its bins: least squares, ends and openings."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.walls import bins as wall_bins
from perception.bayes.walls import fit as wall_fit
from perception.bayes.walls.contact import FOOT
from tests import naive_walls
from tests.perception.bayes.random_tracks import P, examples
from tests.perception.bayes.rooms import SIGMA, facing, fill, new_room, place_wall, reading, refit, spans


@examples(10, 200)
def test_the_line_is_the_least_squares_fit_of_the_covered_bins(examples: int) -> None:
    rng = np.random.default_rng(42)
    _, room = new_room()
    wall = room.walls[0]
    for _ in range(examples):
        place_wall(wall, rng.uniform(-1, 1, 2), rng.uniform(-3, 3), 1.0)
        wall_bins.clear_wall(wall)
        bins = np.sort(rng.choice(np.arange(20, 180), 40, replace=False))
        u, z, n = (bins - 95.5) * 0.06, rng.normal(1.0, 0.02, 40), rng.uniform(1.0, 9.0, 40)
        for b, offset, weight in zip(bins.tolist(), z.tolist(), n.tolist(), strict=True):
            of = wall.bins[b]
            of.weight, of.precision = weight, weight / SIGMA**2
            of.offset_sum, of.range_sum = of.precision * offset, 2.0 * of.precision
            of.passes = weight + 1.0 if b % 4 == 0 else 0.0
        covered = bins % 4 != 0
        wall_fit.fit_line(wall)
        (offset, slope), cov = naive_walls.line_fit(u[covered], z[covered], n[covered] / SIGMA**2)
        assert (wall.offset, wall.slope) == pytest.approx((offset, slope), abs=1e-9)
        row = (wall.variance_offset, wall.covariance, wall.variance_slope)
        assert row == pytest.approx((cov[0, 0], cov[0, 1], cov[1, 1]), rel=1e-6)
        assert wall.weight == pytest.approx(n[covered].sum())


def test_an_opening_stays_open_where_ranges_pass_and_a_gap_is_closed_where_nothing_was_seen() -> None:
    memory, room = new_room()
    wall = room.walls[0]
    place_wall(wall, np.zeros(2), 0.0, 2.0)
    fill(memory, wall, -2.0, -0.4)
    fill(memory, wall, 0.08, 2.0)
    assert spans(wall) == pytest.approx(np.array([[-1.98, 1.98]]), abs=0.061)
    for _ in range(2):
        wall_bins.enter_pass(wall, wall_bins.bin_of(-0.15), 1.0)
    refit(memory, wall)
    assert spans(wall) == pytest.approx(np.array([[-1.98, -0.42], [0.06, 1.98]]), abs=0.061)


def test_a_single_echo_far_beyond_either_end_is_no_part_of_a_wall() -> None:
    for count, ends in ((1.0, (-0.9, 0.9)), (3.0, (-1.5, 1.5))):
        memory, room = new_room()
        wall = room.walls[0]
        place_wall(wall, np.zeros(2), 0.0, 2.0)
        fill(memory, wall, -0.9, 0.9)
        fill(memory, wall, 1.44, 1.5, count)
        fill(memory, wall, -1.5, -1.44, count)
        refit(memory, wall)
        longest = max(spans(wall), key=lambda span: span[1] - span[0])
        assert longest == pytest.approx(ends, abs=0.061)


def test_echoes_far_before_the_line_at_one_end_do_not_turn_it() -> None:
    memory, room = new_room()
    wall = room.walls[0]
    place_wall(wall, np.zeros(2), 0.0, 2.0)
    fill(memory, wall, -0.9, 0.9)
    for b in (109, 110):
        of = wall.bins[b]
        of.offset_sum = of.precision * 1.9
    for _ in range(3):
        refit(memory, wall)
    assert (wall.offset, wall.slope) == pytest.approx((2.0, 0.0), abs=2e-3)
    assert spans(wall) == pytest.approx(np.array([[-0.9, 0.8]]), abs=0.1), "those beside them are left out, too"


def test_echoes_of_an_end_do_not_lengthen_a_wall() -> None:
    rng = np.random.default_rng(44)
    memory, room = new_room()
    wall = room.walls[0]
    place_wall(wall, np.zeros(2), 0.0, 2.0)
    fill(memory, wall, -1.5, 0.9, 8.0)
    for y in np.arange(0.9, 1.5, 0.01).tolist():
        q = reading(1.0, y, facing(0.0, rng), math.hypot(1.0, y - 0.9) + rng.normal(0, SIGMA))
        wall_bins.enter_reading(room, wall, q, FOOT, P)
    refit(memory, wall)
    assert spans(wall)[-1, 1] == pytest.approx(0.9, abs=0.13)
    assert wall.offset == pytest.approx(2.0, abs=0.005)


def test_passes_empty_a_bin_and_a_wall_without_bins_ends() -> None:
    memory, room = new_room()
    wall = room.walls[0]
    place_wall(wall, np.zeros(2), 0.0, 2.0)
    fill(memory, wall, 0.0, 0.5, 2.0)
    for b in range(88, 108):
        for _ in range(6):
            wall_bins.enter_pass(wall, b, 1.0)
    refit(memory, wall)
    assert (wall.weight, wall.span_count) == (0.0, 0)
