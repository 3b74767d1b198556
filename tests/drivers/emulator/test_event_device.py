"""What emulated robots share: every shipped family's device is one, and time passes only by `advance`."""

from __future__ import annotations

import pytest

from config.files import list_shipped
from config.load import load_robot
from config.world import WorldConfig
from drivers.emulator.event_device import EventDevice
from drivers.registry import make_device


@pytest.mark.parametrize("name", list_shipped("robots"))
def test_the_devices_of_shipped_robots_share_their_passing_of_time(name: str) -> None:
    device = make_device(load_robot(name), WorldConfig(), 1)
    assert isinstance(device, EventDevice)
    device.advance(0.5)
    assert 0.4 < device.truth.emulated_s <= 0.5
    assert device.advance(0.5) == b""
    assert device.plugged
    assert device.dropped == 0
