"""Move-to-goal: its magnitude by distance, and that a reached goal stays reached."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError

from behaviors.move_to_goal import Goal, move_to_goal
from config.behaviors import MoveToGoalConfig
from perception.percept import Percept, Pose
from tests.behaviors.views import EVERYWHERE

CONFIG = MoveToGoalConfig(move_to_goal_gain=2.0, success_radius_m=0.1, controlled_zone_m=0.5)


def at(x: float, y: float, theta: float = 0.3) -> Percept:
    return Percept(Pose(x, y, theta), np.empty((0, 2)), EVERYWHERE)


@pytest.mark.parametrize(
    ("distance", "magnitude"), [(50.0, 2.0), (0.5, 2.0), (0.25, 1.0), (0.125, 0.5), (0.1, 0.0), (0.0, 0.0)]
)
@pytest.mark.parametrize("bearing", [0.0, 1.0, math.pi, -2.0])
def test_magnitude_by_distance(distance: float, magnitude: float, bearing: float) -> None:
    goal = Goal(1.0 + distance * math.cos(bearing), -2.0 + distance * math.sin(bearing))
    reached = distance <= 0.1
    # Rounding may put a goal on the success radius to either side of it.
    goal = Goal(1.0, -2.0) if distance == 0.0 else goal
    near = at(1.0 + 1e-9 * math.cos(bearing), -2.0 + 1e-9 * math.sin(bearing)) if reached else at(1.0, -2.0)
    response, after = move_to_goal(near, goal, CONFIG)
    assert response.schema == "move_to_goal"
    assert (response.x, response.y) == pytest.approx(
        (magnitude * math.cos(bearing), magnitude * math.sin(bearing)), abs=1e-9
    )
    assert after == Goal(goal.x, goal.y, reached=reached)


def test_a_reached_goal_stays_reached() -> None:
    _, goal = move_to_goal(at(0.0, 0.05), Goal(0.0, 0.0), CONFIG)
    response, later = move_to_goal(at(30.0, 40.0), goal, CONFIG)
    assert (response.x, response.y) == (0.0, 0.0)
    assert later is goal


def test_a_non_finite_pose_gives_a_non_finite_vector() -> None:
    response, goal = move_to_goal(at(math.nan, 0.0), Goal(1.0, 0.0), CONFIG)
    assert math.isnan(response.x)
    assert not goal.reached


def test_a_success_radius_beyond_the_controlled_zone_is_refused() -> None:
    with pytest.raises(ValidationError, match="success_radius_m is above controlled_zone_m"):
        MoveToGoalConfig(success_radius_m=0.7)
