"""Rules between the settings of a schema."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from pydantic import BaseModel, ValidationError

from config.behaviors import AvoidStaticObstacleConfig, MoveToGoalConfig


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: AvoidStaticObstacleConfig(avoid_obstacle_safety_margin_m=0.6),
            "avoid_obstacle_safety_margin_m is not below avoid_obstacle_sphere_m",
        ),
        (lambda: MoveToGoalConfig(success_radius_m=0.61), "success_radius_m is above controlled_zone_m"),
    ],
)
def test_contradictions_in_a_schema_are_refused(make: Callable[[], BaseModel], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        make()


def test_values_on_the_allowed_side_are_accepted() -> None:
    AvoidStaticObstacleConfig(avoid_obstacle_safety_margin_m=0.599)
    MoveToGoalConfig(success_radius_m=0.6)
