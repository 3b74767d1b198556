"""The percept: what behaviours see of one cycle."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from drivers.messages import Firing
from perception.percept import Percept, Pose, wrap_angle
from perception.pipeline import Perception
from tests.behaviors.views import EVERYWHERE
from tests.perception.edited import fresh


def test_perception_fills_a_percept_that_cannot_be_changed() -> None:
    perception: Perception = fresh("paper")
    ranges = np.full(24, np.nan)
    ranges[0] = 1.0
    pose = Pose(1.0, 0.0, 0.0)
    perception.observe(Firing(0.0, pose, 0.0, ranges))
    view = perception.surroundings(0.0, 0.0, pose, 1.0)[0]
    percept = Percept(pose, perception.obstacles(0.0, 1.0), view, perception.objects())
    assert percept.obstacles.shape == (1, 2)
    assert np.isfinite(percept.obstacles).all()
    assert percept.objects == ()
    assert wrap_angle(percept.pose.theta + 7.0) == pytest.approx(7.0 - 2.0 * np.pi)
    with pytest.raises(dataclasses.FrozenInstanceError):
        percept.pose = pose  # type: ignore[misc]


def test_by_default_no_object_is_recognised() -> None:
    assert Percept(Pose(0.0, 0.0, 0.0), np.zeros((0, 2)), EVERYWHERE).objects == ()
