"""The family's entry in the registry."""

from __future__ import annotations

from config.load import load_robot
from drivers.arcos.driver import ArcosDriver
from drivers.registry import make_driver


def test_the_registry_makes_the_driver() -> None:
    assert isinstance(make_driver(load_robot("p3dx")), ArcosDriver)
