"""The family's entry in the registry."""

from __future__ import annotations

import pytest

from config.load import load_robot
from config.world import WorldConfig
from drivers.denning.device import DenningDevice
from drivers.denning.driver import DenningDriver
from drivers.driver import DriverError
from drivers.registry import line_options, make_device, make_driver
from drivers.ros2.family import OPEN_TIMEOUT_S
from tests.drivers.ros2.robot import CONFIG


def test_the_registry_makes_both_ends() -> None:
    assert isinstance(make_driver(CONFIG), DenningDriver)
    assert isinstance(make_device(CONFIG, WorldConfig(), 1), DenningDevice)
    assert line_options(CONFIG)["open_timeout_s"] == OPEN_TIMEOUT_S
    assert line_options(load_robot("denning")) == {}


def test_each_sensor_needs_its_frame_and_the_ring_turns_with_the_base() -> None:
    few = CONFIG.model_copy(update={"ros2": CONFIG.ros2.model_copy(update={"frames": ("a",)})})
    with pytest.raises(DriverError, match="1 frames for the ring's 8 sensors"):
        make_driver(few)
    synchro = CONFIG.model_copy(update={"body": CONFIG.body.model_copy(update={"synchro": True})})
    with pytest.raises(DriverError, match=r"body\.synchro"):
        make_driver(synchro)
