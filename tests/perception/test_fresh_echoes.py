"""Each sensor's last echo as an obstacle: its place, its age, and what removes it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.messages import Firing, Pose
from perception.fresh_echoes import FreshEchoes
from perception.pipeline import Perception
from tests.perception.halls import settings

MOUNTS = np.array([[0.4, 0.0, 0.0], [0.0, 0.4, math.pi / 2]])


def test_echoes_are_obstacles_until_the_sensor_fires_again_or_they_age() -> None:
    """A reading at maximum range clears only its own sensor's obstacle."""
    chosen = settings()
    perception = Perception(chosen.ring, chosen.models, chosen.perception)
    ranges = np.full(24, np.nan)
    ranges[0], ranges[1] = 1.0, 2.0
    perception.observe(Firing(0.0, Pose(1.0, 0.0, 0.0), 0.0, ranges))
    points = perception.obstacles(0.5, 1.0)
    assert points[0] == pytest.approx((1.0 + 0.381 + 1.0, 0.0))
    assert points[1] == pytest.approx((1.0 + 2.381 * math.cos(math.pi / 12), 2.381 * math.sin(math.pi / 12)))
    assert len(perception.obstacles(1.5, 1.0)) == 0
    later = np.full(24, np.nan)
    later[0] = math.inf
    perception.observe(Firing(0.6, Pose(1.0, 0.0, 0.0), 0.0, later))
    assert perception.obstacles(0.6, 1.0) == pytest.approx(points[1:])


def test_an_echo_lies_on_the_axis_of_its_turned_sensor() -> None:
    echoes = FreshEchoes(MOUNTS)
    echoes.update(Firing(1.0, Pose(1.0, 2.0, 0.3), math.pi / 2, np.array([1.0, 2.0])))
    np.testing.assert_allclose(echoes.points(1.0, 0.0), [[1.0, 3.4], [-1.4, 2.0]], atol=1e-12)


def test_a_sensor_that_does_not_fire_keeps_its_echo_and_the_age_limit_is_inclusive() -> None:
    echoes = FreshEchoes(MOUNTS)
    echoes.update(Firing(1.0, Pose(0.0, 0.0, 0.0), 0.0, np.array([1.0, 2.0])))
    echoes.update(Firing(2.0, Pose(0.0, 0.0, 0.0), 0.0, np.array([3.0, math.nan])))
    assert len(echoes.points(2.0, 1.0)) == 2
    assert echoes.points(2.0, 0.5) == pytest.approx(np.array([[3.4, 0.0]]))
    echoes.clear()
    assert len(echoes.points(2.0, math.inf)) == 0
