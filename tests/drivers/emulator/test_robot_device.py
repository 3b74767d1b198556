"""What every emulated robot does, whatever its family: time passes by `advance` alone, and the truth is its own."""

from __future__ import annotations

import pytest

from config.world import StartConfig, WorldConfig
from drivers import registry
from drivers.emulator.robot_device import RobotDevice
from drivers.messages import Flags, Pose, Twist
from tests.drivers.contract.families import FAMILIES


@pytest.fixture(params=sorted(registry.SHIPPED))
def device(request: pytest.FixtureRequest) -> RobotDevice:
    world = WorldConfig(start=StartConfig(x_m=1.0, y_m=2.0, heading_deg=90.0))
    return registry.make_device(FAMILIES[request.param].robot, world, seed=1)


def test_it_starts_at_rest_where_the_world_says(device: RobotDevice) -> None:
    truth = device.truth
    assert truth.emulated_s == 0.0
    assert (truth.pose.x, truth.pose.y) == (1.0, 2.0)
    assert truth.pose.theta == pytest.approx(1.5707963)
    assert (truth.twist, truth.contacts) == (Twist(0.0, 0.0), 0)
    assert device.plugged


def test_its_time_passes_by_advance_alone_and_it_survives_any_bytes(device: RobotDevice) -> None:
    device.receive(bytes(range(256)))
    device.advance(1.0)
    assert device.advance(1.0) == b"", "no time has passed"
    assert 0.9 < device.truth.emulated_s <= 1.0
    assert device.truth.pose == Pose(1.0, 2.0, device.truth.pose.theta)
    stands = Flags.DEADMAN | Flags.LATCHED
    assert device.truth.flags & stands, "by itself or until it is released"
    assert not device.truth.flags & ~stands


def test_a_frame_counter_starts_empty(device: RobotDevice) -> None:
    counter = device.frame_counter()
    assert counter.echoes(device.advance(0.5)) == 0, "no firing pattern was set"
    assert counter.drives(b"") == 0
