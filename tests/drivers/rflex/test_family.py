"""The family's entry in the registry."""

from __future__ import annotations

from config.load import load_robot
from config.world import WorldConfig
from drivers.registry import make_device, make_driver
from drivers.rflex.device import RflexDevice
from drivers.rflex.driver import RflexDriver


def test_the_registry_makes_both_ends() -> None:
    config = load_robot("magellan")
    assert isinstance(make_driver(config), RflexDriver)
    assert isinstance(make_device(config, WorldConfig(), 1), RflexDevice)
