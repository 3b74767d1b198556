"""Swirl: obstacles deflect the robot to the side of its way."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError

from behaviors.swirl import swirl
from config.behaviors import SwirlConfig
from perception.percept import Floats, Percept, Pose
from tests.behaviors.views import EVERYWHERE

SWIRL = SwirlConfig(swirl_gain=1.0, swirl_sphere_m=3.0, swirl_safety_margin_m=0.5)


def seen(obstacles: Floats | None = None) -> Percept:
    return Percept(Pose(0.0, 0.0, 0.0), np.empty((0, 2)) if obstacles is None else obstacles, EVERYWHERE)


@pytest.mark.parametrize(("y", "sign"), [(0.2, -1.0), (-0.2, 1.0)])
def test_an_obstacle_deflects_to_its_other_side(y: float, sign: float) -> None:
    response = swirl(seen(obstacles=np.array([[1.0, y]])), 0.0, 0.381, SWIRL)
    assert sign * response.y > 0.5
    assert response.x > 0.0


def test_many_echoes_of_one_wall_deflect_like_one_and_far_ones_not_at_all() -> None:
    wall = np.column_stack([np.full(10, 1.0), np.linspace(0.1, 1.0, 10)])
    response = swirl(seen(obstacles=wall), 0.0, 0.381, SWIRL)
    assert math.hypot(response.x, response.y) <= 1.0
    assert swirl(seen(obstacles=np.array([[5.0, 0.0]])), 0.0, 0.381, SWIRL).y == 0.0
    assert swirl(seen(), 0.0, 0.381, SWIRL).x == 0.0


def test_a_margin_beyond_the_sphere_is_refused() -> None:
    with pytest.raises(ValidationError, match="swirl_safety_margin_m is not below swirl_sphere_m"):
        SwirlConfig(swirl_sphere_m=0.4)
