"""Reported walls: ends of the spans, as far as the corners in which they end."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.memory.state import ESTABLISHED
from perception.bayes.reports.object_report import wall_object
from perception.bayes.walls.bins import free
from perception.bayes.walls.report import room_report
from tests.perception.bayes.rooms import fill, new_room, place_wall, wall_ends


def test_each_wall_needs_evidence_and_the_first_one_weight_as_well() -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -1.0, 1.0)
    place_wall(room.walls[1], np.zeros(2), math.pi, 2.0)
    fill(memory, room.walls[1], -1.0, 1.0)
    for first, second, reported in ((39.0, 39.0, 0), (41.0, 41.0, 2), (41.0, 39.0, 1)):
        for wall, chi2 in zip(room.walls, (first, second), strict=False):
            wall.chi2 = wall.spans[0].chi2 = chi2
        assert len(room_report(memory)[0]) == reported
    room.walls[0].spans[0].chi2 = room.walls[1].spans[0].chi2 = 41.0
    for first, second, reported in ((13.0, 11.0, 2), (11.0, 11.0, 0)):
        room.walls[0].spans[0].weight, room.walls[1].spans[0].weight = first, second
        assert len(room_report(memory)[0]) == reported


def test_a_short_span_in_line_with_a_long_one_is_evidence_with_it() -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -1.0, 1.0)
    place_wall(room.walls[1], np.zeros(2), math.pi, 2.0)
    fill(memory, room.walls[1], -0.9, 0.0)
    fill(memory, room.walls[1], 1.2, 1.44)
    wall = room.walls[1]
    wall.spans[0].chi2, wall.chi2 = 3.0, 50.0
    assert wall.span_count == 2
    for weight, reported in ((4.0, 1), (6.0, 2)):
        wall.spans[1].weight = weight
        assert len(room_report(memory)[0]) == reported


def test_a_short_wall_that_touches_a_named_drum_is_its_side() -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -2.0, -0.5)
    fill(memory, room.walls[0], 0.5, 0.98)
    assert len(room_report(memory)[0]) == 2
    drum = memory.tracks[0]
    drum.status, drum.is_named, drum.radius = ESTABLISHED, 1, 0.3
    drum.x, drum.y = 2.3, 0.74
    assert room_report(memory)[0]["y2"] == pytest.approx([-0.5], abs=0.1)
    drum.x = 2.5  # stands behind it
    assert len(room_report(memory)[0]) == 2


def test_short_light_and_bent_lines_are_no_walls() -> None:
    memory, room = new_room()
    wall = room.walls[0]
    for low, high, count, is_wall in ((-0.6, 0.6, 5.0, True), (-0.12, 0.12, 9.0, False), (-0.6, 0.6, 0.3, False)):
        free(wall)
        place_wall(wall, np.zeros(2), 0.0, 2.0)
        fill(memory, wall, low, high, count)
        assert len(wall_ends(memory)) == is_wall
    free(wall)
    place_wall(wall, np.zeros(2), 0.0, 2.0)
    fill(memory, wall, -0.6, 0.6)
    wall.misfit = 3.1
    assert len(wall_ends(memory)) == 0
    for evidence, is_wall in ((90.0, True), (79.0, False)):  # 40 are needed
        wall.misfit, wall.chi2, wall.spans[0].chi2 = 2.0, evidence, evidence
        assert len(wall_ends(memory)) == is_wall, "what scatters twice as much as noise needs twice the evidence"


def test_a_line_through_a_named_drum_is_no_wall() -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -0.9, 0.9)
    drum = memory.tracks[0]
    drum.status, drum.is_named, drum.radius, drum.y = ESTABLISHED, 1, 0.3, 0.5
    for x, is_wall in ((2.2, False), (1.7, True), (2.2, False)):
        drum.x = x
        assert len(wall_ends(memory)) == is_wall
    drum.y = 1.3
    assert len(wall_ends(memory)) == 1, "beyond its end"
    drum.y, drum.is_named = 0.5, 0
    assert len(wall_ends(memory)) == 1


def test_a_segment_is_an_object_with_its_length_in_its_covariance() -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.3, 2.0)
    fill(memory, room.walls[0], -0.9, 0.9)
    (segment,) = room_report(memory)[0]
    seen = wall_object(segment.item())
    (x1, y1, x2, y2), t = wall_ends(memory)[0], np.array([math.cos(seen.theta), math.sin(seen.theta)])
    assert (seen.x, seen.y) == pytest.approx((0.5 * (x1 + x2), 0.5 * (y1 + y2)))
    assert t @ (x2 - x1, y2 - y1) == pytest.approx(math.hypot(x2 - x1, y2 - y1))
    assert seen.covariance is not None
    xx, xy, yy = seen.covariance
    assert 12.0 * (t @ np.array([[xx, xy], [xy, yy]]) @ t) == pytest.approx((x2 - x1) ** 2 + (y2 - y1) ** 2)
    assert seen.model == "wall"
    assert seen.probability is not None
    assert 0.9 < seen.probability < 1.0
