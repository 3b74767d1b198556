"""Robots that people have recognise the six drums of the hall.

The sonar of a Pioneer has no times, and its SIPs come ten times a second; an rFLEX fires its banks by itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from config.load import list_shipped, load_robot, load_settings
from config.units import FOOT_M
from runtime.simulation.closed_loop import simulate

pytestmark = pytest.mark.compiled

ROBOTS = tuple(name for name in list_shipped("robots") if load_robot(name).robot.driver in {"arcos", "rflex"})
OFF_MAX_FT = 0.005


def check_drums(name: str, model: str, seed: int, seconds: float) -> str:
    """Drive down the hall; all drums and nothing else are found, and nothing was touched."""
    settings = load_settings("hallway", [f"world.acoustics.model={model}"], robot=name)
    world = settings.world
    assert world is not None
    result = simulate(settings, world, seed, seconds)
    objects = result.state.perception.objects()
    places = [(drum.x_m - world.start.x_m, drum.y_m - world.start.y_m) for drum in world.drum]
    off_ft = [min(math.hypot(o.x - x, o.y - y) for o in objects) / FOOT_M for x, y in places]
    assert len(objects) == len(places)
    assert max(off_ft) <= OFF_MAX_FT
    assert result.truth.contacts == 0
    return f"{name}, {model}: 6/6, 0 false, worst {max(off_ft):.4f} ft"


@pytest.mark.parametrize(("name", "seconds"), [("p3dx", 18.0), pytest.param("b21r", 18.0, marks=pytest.mark.soak)])
def test_a_robot_finds_six_drums(name: str, seconds: float, measured: Callable[[str], None]) -> None:
    measured(check_drums(name, "specular", 4, seconds))


@pytest.mark.soak
@pytest.mark.parametrize("model", ["specular", "cone"])
@pytest.mark.parametrize("name", ROBOTS)
def test_every_robot_finds_six_drums(name: str, model: str, measured: Callable[[str], None]) -> None:
    measured(check_drums(name, model, 5, 26.0))
