"""Avoid-past: away from where the robot has been, by way and not by time."""

from __future__ import annotations

import numpy as np
import pytest

from behaviors.avoid_past import MARKS_MAX, Trail, avoid_past
from config.behaviors import AvoidPastConfig
from perception.percept import Percept, Pose
from tests.behaviors.views import EVERYWHERE

PAST = AvoidPastConfig(avoid_past_gain=0.8, horizon_m=1.0, saturation_m=1.0)


def seen(x: float = 0.0) -> Percept:
    return Percept(Pose(x, 0.0, 0.0), np.empty((0, 2)), EVERYWHERE)


def test_the_past_pushes_forward_on_a_straight_way_and_with_more_of_it_more() -> None:
    trail: Trail = ()
    lengths = []
    for k in range(10):
        response, trail = avoid_past(seen(0.101 * k), trail, PAST)
        lengths.append(response.x)
        assert response.y == 0.0
    assert lengths == pytest.approx(sorted(lengths))
    assert lengths[0] == 0.0
    assert lengths[-1] == pytest.approx(0.8)


def test_a_robot_that_stands_marks_nothing_and_old_marks_are_forgotten() -> None:
    _, trail = avoid_past(seen(), (), PAST)
    for _ in range(50):
        _, trail = avoid_past(seen(0.01), trail, PAST)
    assert len(trail) == 1
    _, trail = avoid_past(seen(0.0), tuple((0.0, 1.0 * k) for k in range(1, MARKS_MAX + 9)), PAST)
    assert len(trail) == MARKS_MAX
    assert trail[-1] == (0.0, 0.0)


def test_what_is_beyond_the_horizon_does_not_count() -> None:
    response, _ = avoid_past(seen(), ((1.2, 0.0), (0.0, -1.1)), PAST)
    assert (response.x, response.y) == (0.0, 0.0)
