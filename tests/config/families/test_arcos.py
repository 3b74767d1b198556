"""The section of the Pioneer family: defaults, bounds, and the shipped files' factors."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from config.families.arcos import ArcosConfig
from config.load import load_robot


def test_the_defaults_are_those_of_newer_controllers() -> None:
    config = ArcosConfig()
    assert (config.distance_factor, config.velocity_factor, config.range_factor) == (1.0, 1.0, 1.0)
    assert config.discs is None
    assert config.subclasses == ()


@pytest.mark.parametrize("value", [{"discs": (32,)}, {"distance_factor": 0.0}, {"turn_factor": 5.6}, {"factor": 1.0}])
def test_bounds(value: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        ArcosConfig(**value)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "sensors", "distance", "velocity", "wheel_base_mm"),
    [
        ("p3dx", 16, 0.485, 1.0, 357),
        ("p3dx-sh", 16, 1.0, 1.0, 357),
        ("p3at", 16, 0.465, 1.0, 588),
        ("amigo", 8, 0.5083, 0.6154, 182),
        ("peoplebot", 32, 1.0, 1.0, 333),
        ("powerbot", 28, 0.5813, 1.0, 536),
    ],
)
def test_the_shipped_pioneers(name: str, sensors: int, distance: float, velocity: float, wheel_base_mm: int) -> None:
    robot = load_robot(name)
    assert robot.robot.driver == "arcos"
    assert len(robot.ring.mounts) == sensors
    assert (robot.arcos.distance_factor, robot.arcos.velocity_factor) == (distance, velocity)
    assert 2.0 / robot.arcos.turn_factor == pytest.approx(wheel_base_mm, abs=0.5)
    assert name in robot.arcos.subclasses or f"{name}-sh" in robot.arcos.subclasses
    assert robot.link.deadman_max_s == 2.0
    first, last = robot.ring.mounts[0], robot.ring.mounts[-1]
    assert first.angle_rad > 0.0
    assert abs(last.x_m) <= robot.body.radius_m
