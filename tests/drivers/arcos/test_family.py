"""The family's entry in the registry."""

from __future__ import annotations

from config.load import load_robot
from config.world import WorldConfig
from drivers.arcos.device import ArcosDevice
from drivers.arcos.driver import ArcosDriver
from drivers.arcos.family import firmware_of
from drivers.arcos.firmware import Firmware
from drivers.registry import make_device, make_driver


def test_the_registry_makes_the_driver() -> None:
    assert isinstance(make_driver(load_robot("p3dx")), ArcosDriver)


def test_an_emulated_robot_has_the_robot_files_factors() -> None:
    firmware = firmware_of(load_robot("amigo"))
    assert firmware == Firmware("amigo", 0.5083, 0.6154, 1.0, 0.011, tuple(range(8)))
    assert firmware_of(load_robot("powerbot")).sensor_numbers[7] == 8
    assert isinstance(make_device(load_robot("p3dx"), WorldConfig(), 1), ArcosDevice)
