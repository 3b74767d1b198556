"""Reported walls compared with the truth: found and false length, lines, offset and angle."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.trials.wall_trials import (
    Corner,
    CornerTrial,
    Segment,
    compare,
    compare_corners,
    figures,
    joined,
    reported_corners,
    reported_walls,
    spans_of,
    true_corners,
)
from perception.detected_object import DetectedObject


def segment(x1: float, y1: float, x2: float, y2: float) -> Segment:
    """A segment from end to end."""
    return Segment(np.array([x1, y1]), np.array([x2, y2]))


WALL = segment(0.0, 0.0, 4.0, 0.0)
ANSWERED = np.concatenate([np.linspace(1.0, 2.0, 21), np.linspace(2.3, 3.0, 15)])
"""What answered: from 1 to 3 m, but for a short gap."""
NONE = CornerTrial(0, 0, (), 0)


def test_a_wall_found_whole_with_its_offset_and_angle() -> None:
    turn = math.radians(1.0)
    along = np.array([math.cos(turn), math.sin(turn)])
    middle = np.array([2.0, 0.01])
    trial = compare([WALL], [ANSWERED], [Segment(middle - 1.02 * along, middle + 1.02 * along)], NONE)
    assert (trial.walls, trial.lines) == (1, 1)
    assert trial.answered_m == pytest.approx(2.0)
    assert trial.found_m == pytest.approx(2.0)
    assert trial.false_m == 0.0
    assert trial.offsets_m == pytest.approx((0.01,))
    assert trial.angles_rad == pytest.approx((turn,))


def test_length_off_the_wall_or_across_it_is_false() -> None:
    beyond, across = segment(3.0, 0.0, 5.0, 0.0), segment(2.0, -0.5, 2.0, 0.5)
    trial = compare([WALL], [ANSWERED], [beyond, across], NONE)
    assert trial.false_m == pytest.approx(2.0, abs=0.1)
    assert trial.reported_m == pytest.approx(3.0)
    assert trial.found_m == 0.0
    assert trial.lines == 1


def test_a_wall_that_hardly_answered_does_not_count() -> None:
    few = np.linspace(0.0, 0.4, 8)
    trial = compare([WALL], [few], [segment(0.0, 0.0, 0.4, 0.0)], NONE)
    assert (trial.walls, trial.lines, trial.answered_m) == (0, 0, 0.0)


def test_points_that_are_far_apart_are_two_spans() -> None:
    assert spans_of(np.array([0.1, 0.4, 1.0, 1.3, 1.6])) == [(0.1, 0.4), (1.0, 1.6)]
    assert spans_of(np.zeros(0)) == []


def test_two_lines_on_one_place_count_once() -> None:
    assert joined([(1.0, 3.0), (0.0, 2.0), (2.5, 2.8), (4.0, 5.0)]) == [
        (0.0, 2.0),
        (2.0, 3.0),
        (3.0, 3.0),
        (4.0, 5.0),
    ]
    trial = compare([WALL], [ANSWERED], [segment(0.9, 0.0, 2.5, 0.0), segment(2.0, 0.0, 3.5, 0.0)], NONE)
    assert trial.lines == 2
    assert trial.found_m == pytest.approx(2.0)


def test_a_reported_wall_ends_where_its_covariance_says() -> None:
    xx, xy, yy = 9.0 / 12.0 * 0.5, 9.0 / 12.0 * 0.5, 9.0 / 12.0 * 0.5
    wall = DetectedObject("wall", 1.0, 2.0, math.radians(45.0), 0.0, 9, 1.0, 1.0, (xx, xy, yy))
    (found,) = reported_walls([wall, DetectedObject("drum", 0.0, 0.0, 0.0, 0.1, 9, 1.0)])
    assert found.length_m == pytest.approx(3.0)
    assert 0.5 * (found.begin + found.end) == pytest.approx([1.0, 2.0])
    assert found.direction == pytest.approx([math.sqrt(0.5)] * 2)


def test_figures_of_several_drives() -> None:
    seen = CornerTrial(3, 2, (0.01, 0.02, 0.03), 1)
    found = figures(
        [compare([WALL], [ANSWERED], [segment(1.0, 0.02, 3.0, 0.02)], seen), compare([WALL], [ANSWERED], [], NONE)]
    )
    assert (found.rooms, found.walls) == (2, 2)
    assert found.found == pytest.approx(0.5)
    assert found.lines_a_wall == 0.5
    assert found.offset_mean_m == pytest.approx(0.02)
    assert (found.corners, found.false_corners) == (3, 0.5)
    assert found.corners_found == pytest.approx(2 / 3)
    assert found.corner_mean_m == pytest.approx(0.02)
    nothing = figures([compare([WALL], [ANSWERED], [], NONE)])
    assert (nothing.false, nothing.corners_found, nothing.false_corners) == (0.0, 0.0, 0.0)


def test_walls_meet_in_inside_corners_and_end_at_edges() -> None:
    walls = [segment(0.0, 0.0, 4.0, 0.0), segment(4.0, 3.0, 4.0, 0.0)]
    assert true_corners(walls) == [
        Corner(0.0, 0.0, is_edge=True),
        Corner(4.0, 0.0, is_edge=False),
        Corner(4.0, 3.0, is_edge=True),
    ]


def test_reported_corners_are_right_near_a_true_one_of_their_kind() -> None:
    names = (("edge", 0.1, 0.0), ("inside corner", 4.0, 0.03), ("inside corner", 0.0, 0.0), ("post", 4.0, 0.0))
    objects = [DetectedObject(name, x, y, 0.0, 0.01, 9, 1.0) for name, x, y in names]
    true = [Corner(0.0, 0.0, is_edge=True), Corner(4.0, 0.0, is_edge=False), Corner(4.0, 3.0, is_edge=True)]
    trial = compare_corners(true, [9, 40, 30], reported_corners(objects))
    assert (trial.answered, trial.found, trial.false) == (2, 1, 1)
    assert trial.errors_m == pytest.approx((0.1, 0.03))
    assert compare_corners(true, [9, 40, 30], []) == CornerTrial(2, 0, (), 0)
