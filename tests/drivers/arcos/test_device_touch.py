"""The bumpers of an emulated Pioneer: pressed where a surface is, and a stall towards it."""

from __future__ import annotations

import pytest

from config.world import DrumConfig, WallConfig, WorldConfig
from drivers.arcos.commands import CommandNumber
from drivers.arcos.frames import (
    SipFlags,
)
from drivers.messages import Flags, Twist
from tests.drivers.arcos.device_host import Client
from tests.drivers.device_host import script

STILL = Twist(0.0, 0.0)
VEL = CommandNumber.VEL


@pytest.mark.parametrize(
    ("speed", "front", "rear"), [(300, SipFlags(1 << 3), SipFlags(0)), (-300, SipFlags(0), SipFlags(1 << 3))]
)
def test_a_wall_stalls_the_wheels_and_presses_the_middle_of_the_bumper(speed: int, front: int, rear: int) -> None:
    walls = tuple(WallConfig(x1_m=x, y1_m=-5.0, x2_m=x, y2_m=5.0) for x in (-1.0, 1.0))
    client = Client(WorldConfig(wall=walls)).opened(motors=True)
    client.send(VEL, speed)
    client.run(5.0, pulse_s=0.5)
    assert abs(client.robot.truth.pose.x) == pytest.approx(0.75, abs=1e-5)
    sip = client.sip()
    assert (sip.stall_right & 0xFE, sip.stall_left & 0xFE) == (front, rear)
    assert sip.stall_right & sip.stall_left & 1
    assert client.robot.flags & (Flags.BUMPER | Flags.MOTOR_FAULT) == Flags.BUMPER | Flags.MOTOR_FAULT
    client.send(VEL, -speed)
    client.run(1.5)
    assert client.sip().stall_right | client.sip().stall_left == 0


def test_a_drum_on_the_left_presses_the_left_segment() -> None:
    world = WorldConfig(drum=(DrumConfig(x_m=1.0, y_m=0.5, radius_m=0.3),))
    client = Client(world).opened(motors=True)
    client.send(VEL, 300)
    client.run(4.0, pulse_s=0.5)
    assert client.sip().stall_right & 0xFE == 1 << 1


def test_with_bumpstall_a_pressed_bumper_stops_the_base_that_way_only() -> None:
    faults = script(kind="bumper", at_s=1.0, duration_s=3.0)
    client = Client(faults=faults).opened(motors=True)
    client.send(CommandNumber.BUMPSTALL, 3)
    client.send(VEL, 200)
    client.run(1.4)
    assert client.twist == STILL
    assert client.sip().stall_right == 1 | 1 << 3
    client.send(VEL, -200)
    client.run(1.0)
    assert client.twist.v == pytest.approx(-0.2)
