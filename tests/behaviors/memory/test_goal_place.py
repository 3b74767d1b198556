"""A place of the map in odometry's frame; tests/runtime/cycle/test_drive_requests.py corrects the map in a drive."""

from __future__ import annotations

import pytest

from behaviors.memory.goal_place import GOAL_SLEW_M_S, GoalPlace, goal_place
from behaviors.move_to_goal import Goal
from perception.percept import Pose


def test_a_place_moves_no_faster_than_the_limit_and_says_whether_it_is_there() -> None:
    goal, frame = Goal(1.0, 0.0, frame="map"), Pose(1.0, 1.0, 0.0)
    assert goal_place(goal, None, None, 0.1) is None
    assert goal_place(goal, None, frame, 0.1) == GoalPlace(2.0, 1.0)
    slow = goal_place(goal, GoalPlace(2.0, 0.0), frame, 0.1)
    assert slow == GoalPlace(2.0, pytest.approx(0.1 * GOAL_SLEW_M_S), is_exact=False)  # type: ignore[arg-type]
    assert goal_place(goal, GoalPlace(2.0, 0.999), frame, 0.1) == GoalPlace(2.0, 1.0)
    assert goal_place(Goal(1.0, 0.0), GoalPlace(9.0, 9.0), None, 0.1) == GoalPlace(1.0, 0.0)
