"""The free path ahead of a disc, against a slow oracle, and the speed that it allows."""

from __future__ import annotations

import math

import numpy as np
import pytest

from behaviors.surroundings.clearance import free_path_m, stoppable_speed_m_s
from config.robot import PASSAGE_M, BodyConfig
from perception.percept import Percept, Pose
from tests.behaviors.views import EVERYWHERE

BODY = BodyConfig(radius_m=0.4, speed_max_m_s=0.5, turn_max_rad_s=1.0, acceleration_max_m_s2=0.5)
REACH_M = 0.5
STEP_M = 0.002


def seen(*points: tuple[float, float], theta: float = 0.0) -> Percept:
    return Percept(Pose(0.0, 0.0, theta), np.array(points, dtype=np.float64).reshape(-1, 2), EVERYWHERE)


def naive_free_path(percept: Percept, reach_m: float) -> float:
    """Move the disc forward in small steps until it covers an echo that was ahead at the start."""
    c, s = math.cos(percept.pose.theta), math.sin(percept.pose.theta)
    relative = percept.obstacles - np.array([percept.pose.x, percept.pose.y])
    ahead = relative[relative @ np.array([c, s]) > 0.0]
    for step in range(2000):
        moved = ahead - STEP_M * step * np.array([c, s])
        if (np.hypot(moved[:, 0], moved[:, 1]) < reach_m).any():
            return STEP_M * step
    return math.inf


def test_free_path_agrees_with_the_oracle() -> None:
    rng = np.random.default_rng(97)
    found = []
    for _ in range(40):
        x, y, theta = rng.uniform((-1.0, -1.0, -7.0), (1.0, 1.0, 7.0)).tolist()
        percept = Percept(Pose(x, y, theta), rng.uniform(-3.0, 3.0, (5, 2)), EVERYWHERE)
        slow = naive_free_path(percept, REACH_M)
        found.append(free_path_m(percept, REACH_M))
        assert found[-1] == (slow if slow == math.inf else pytest.approx(slow, abs=1.1 * STEP_M))
    assert 0 < found.count(math.inf) < len(found)
    assert 0 < found.count(0.0) < len(found)


def test_echoes_behind_and_beside_leave_the_path_free() -> None:
    assert free_path_m(seen(), REACH_M) == math.inf
    assert free_path_m(seen((-0.1, 0.0), (1.0, REACH_M), (1.0, -REACH_M)), REACH_M) == math.inf
    assert free_path_m(seen((0.0, 2.0), theta=math.pi / 2.0), REACH_M) == pytest.approx(1.5)


def test_the_speed_is_that_from_which_full_braking_keeps_the_clearance() -> None:
    """Rim 0.4 m, clearance 0.1 m and 0.5 m/s²: an echo at 0.75 m leaves 0.25 m of path, so √(2·0.5·0.25) m/s."""
    assert stoppable_speed_m_s(seen((0.75, 0.0)), BODY, 0.1) == pytest.approx(0.5)
    assert stoppable_speed_m_s(seen((0.75, 0.0)), BODY, 0.35) == 0.0
    assert stoppable_speed_m_s(seen(), BODY, 0.1) == math.inf


def test_a_cautious_robot_passes_what_is_beside_its_way_and_stops_before_what_is_in_it() -> None:
    """Rim 0.4 m, clearance 0.2 m: posts 1.1 m apart leave 0.15 m on either side."""
    posts = seen((0.1, 0.55), (0.1, -0.55))
    assert stoppable_speed_m_s(posts, BODY, 0.2) == 0.0
    assert stoppable_speed_m_s(posts, BODY, 0.2, 0.1) == 0.1
    assert stoppable_speed_m_s(seen((0.9, 0.55)), BODY, 0.2, 0.1) > 0.1, "from afar no slower than without caution"
    assert stoppable_speed_m_s(seen((0.1, 0.4 + PASSAGE_M - 0.01)), BODY, 0.2, 0.1) == 0.0
    assert stoppable_speed_m_s(seen((0.6, 0.0)), BODY, 0.2, 0.1) == 0.0
    assert stoppable_speed_m_s(seen((0.1, 0.45)), BODY, 0.02, 0.1) == math.inf, "a clearance below that is kept"
