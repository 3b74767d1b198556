"""Whether a line is a wall: evidence against a circle by least squares, and what is sure."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes import wall_evidence
from perception.bayes.wall_bins import enter_reading, free
from perception.bayes.wall_contact import FOOT
from tests import naive_walls
from tests.perception.bayes.rooms import SIGMA, fill, new_room, place_wall, reading, refit, spans
from tests.perception.bayes.tracks import P, examples


@examples(10, 200)
def test_evidence_against_a_circle_is_that_of_two_least_squares_fits(examples: int) -> None:
    rng = np.random.default_rng(45)
    memory, room = new_room()
    wall = room.walls[0]
    for _ in range(examples):
        place_wall(wall, np.zeros(2), 0.0, 2.0)
        free(wall)
        wall.weight = 1.0
        fill(memory, wall, -0.6, 0.6, 4.0, float(rng.uniform(0.8, 1.9)))
        bins = np.arange(86, 106)
        u, z, n, d = np.zeros(20), np.zeros(20), rng.uniform(1.0, 9.0, 20), rng.uniform(0.8, 1.9, 20)
        for k, b in enumerate(bins.tolist()):
            of = wall.bins[b]
            z[k] = 2.0 + rng.normal(0, 0.003)
            of.weight, of.precision = n[k], n[k] / SIGMA**2
            of.offset_sum, of.range_sum = of.precision * z[k], of.precision * d[k]
        low, high = spans(wall)[0]
        u = (bins - 95.5) * 0.06 - 0.5 * (low + high)
        expected, line = naive_walls.bend(u, z, d, np.hypot(SIGMA / np.sqrt(n), 0.005), 0.7)
        found, misfit = wall_evidence.flatness(wall, 0, 1, P)
        outside = round((found - expected) / 4.0)
        assert found == pytest.approx(expected + 4.0 * outside, abs=1e-3)
        assert outside >= 0
        assert misfit == pytest.approx(line / 18.0, rel=1e-4)


def test_a_long_flat_line_has_evidence_and_a_drums_tangent_has_none() -> None:
    memory, room = new_room()
    wall = room.walls[0]
    place_wall(wall, np.zeros(2), 0.0, 2.0)
    fill(memory, wall, -0.6, 0.6)
    assert wall.chi2 > 50.0
    assert wall.misfit < 1e-6
    free(wall)
    wall.weight = 1.0
    for y in np.arange(-0.4, 0.4, 0.01).tolist():
        q = reading(1.0, y, math.atan2(-y, 1.3), math.hypot(1.3, y) - 0.3)
        enter_reading(room, wall, q, FOOT, P)
    refit(memory, wall)
    assert wall.chi2 < 0.0


def test_spans_are_judged_alone_and_together() -> None:
    memory, room = new_room()
    wall = room.walls[0]
    place_wall(wall, np.zeros(2), 0.0, 2.0)
    fill(memory, wall, -1.2, -0.6, 0.5)
    fill(memory, wall, 0.3, 0.6, 0.3)
    first, second = (wall.spans[k] for k in range(2))
    assert (first.weight, second.weight) == pytest.approx((5.0, 1.5))
    for k, span in enumerate((first, second)):
        assert span.chi2 == wall_evidence.flatness(wall, k, k + 1, P)[0]
    assert wall.chi2 == wall_evidence.flatness(wall, 0, 2, P)[0]
    assert wall.chi2 > first.chi2 > second.chi2 > 0.0
