"""Whether a line is a wall: evidence against a circle by least squares, and what is sure."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.walls import evidence as wall_evidence
from perception.bayes.walls.bins import enter_reading, free
from perception.bayes.walls.contact import FOOT
from perception.bayes.walls.fit import fit_walls
from perception.bayes.walls.report import room_report
from tests import naive_walls
from tests.perception.bayes.random_tracks import P, examples
from tests.perception.bayes.rooms import fill, new_room, place_wall, reading, refit, spans


@examples(5, 100)
def test_evidence_against_a_circle_is_that_of_its_best_place(examples: int) -> None:
    rng = np.random.default_rng(45)
    memory, room = new_room()
    wall = room.walls[0]
    for _ in range(examples):
        place_wall(wall, np.zeros(2), 0.0, 2.0)
        free(wall)
        wall.weight = 1.0
        before = float(rng.uniform(0.8, 1.9))
        fill(memory, wall, -0.6, 0.6, 4.0, before)
        bins = np.arange(86, 106)
        z, n, d = 2.0 + rng.normal(0, 0.02, 20), rng.uniform(1.0, 9.0, 20), rng.uniform(0.8, 1.9, 20)
        for k, b in enumerate(bins.tolist()):
            of = wall.bins[b]
            of.weight, of.precision = n[k], n[k] / 0.15**2
            of.offset_sum, of.range_sum = of.precision * z[k], of.precision * d[k]
        low, high = spans(wall)[0]
        at = (bins - 95.5) * 0.06
        u, e, sigma = at - 0.5 * (low + high), z - wall.offset - wall.slope * at, np.hypot(0.15 / np.sqrt(n), 0.005)
        circles = []
        for radius in (0.7, 0.3):
            centre, squares = naive_walls.best_circle(u, e, d, sigma, radius)
            is_outside = np.abs(np.arctan2(centre[0] - u, before + centre[1])) > math.acos(P[0].cos_may_answer)
            circles.append(np.minimum(squares + 4.0 * is_outside, 16.0).sum())
        line = naive_walls.line_chi2(u, e, sigma)
        found, misfit = wall_evidence.flatness(wall, 0, 1, P)
        assert found == pytest.approx(min(circles) - line, abs=0.05)
        assert misfit == pytest.approx(line / 18.0, rel=1e-4)


def test_a_few_echoes_of_other_surfaces_do_not_make_a_long_wall_crooked() -> None:
    memory, room = new_room()
    wall = room.walls[0]
    place_wall(wall, np.zeros(2), 0.0, 2.0)
    fill(memory, wall, -1.5, 1.5, 4.0)
    for b in (75, 95, 116):
        wall.bins[b].offset_sum -= 0.06 * wall.bins[b].precision
    wall.is_changed = 1
    fit_walls(memory.s, P, 0, 1, 1)
    assert wall.span_count == 1
    assert 0.5 < wall.misfit < 1.5
    assert len(room_report(memory)[0]) == 1


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
