"""Set-points of the emulated Pioneer: ramps, limits, headings and ways, and odometry that drifts."""

from __future__ import annotations

import math

import pytest

from config.world import OdometryConfig, WorldConfig
from drivers.arcos.commands import CommandNumber
from drivers.arcos.frames import (
    ConfigPacket,
    Sip,
)
from drivers.messages import Twist
from tests.drivers.arcos.device_host import SIP_S, Client

STILL = Twist(0.0, 0.0)
ENABLE, VEL, RVEL = CommandNumber.ENABLE, CommandNumber.VEL, CommandNumber.RVEL


def test_nothing_moves_while_the_motors_are_off_and_no_set_point_is_kept() -> None:
    client = Client().opened()
    client.send(VEL, 300)
    client.run(0.5)
    client.send(ENABLE, 1)
    client.run(0.5)
    assert client.sip().flags & 1
    assert client.twist == STILL
    client.send(VEL, 300)
    client.run(1.2)
    assert client.twist.v == pytest.approx(0.3)
    client.send(ENABLE, 0)
    client.run(0.2)
    assert client.twist == STILL
    client.send(ENABLE, 1)
    client.run(0.5)
    assert client.twist == STILL


def test_velocities_ramp_combine_and_show_in_the_sip() -> None:
    client = Client().opened(motors=True)
    client.send(VEL, 200)
    client.send(RVEL, 30)
    client.run(0.3)
    assert client.twist.v == pytest.approx(0.3 * 0.3, abs=0.01)
    client.run(0.8)
    sip = client.sip()
    assert sip.kind == 0x33
    assert (sip.left, sip.right) == (106, 293)
    assert sip.turn_10 == 300
    client.send(CommandNumber.STOP)
    client.run(1.0)
    assert (client.sip().kind, client.sip().left, client.sip().right) == (0x32, 0, 0)


def test_the_odometry_counts_in_the_units_of_the_model_and_wraps() -> None:
    client = Client().opened(motors=True)
    client.send(CommandNumber.SETA, 3000)
    client.send(VEL, -2000)
    client.run(9.0, pulse_s=1.0)
    assert client.sip().x == pytest.approx(
        (round(1e3 * client.robot._body.odometry_pose.x / 0.485) + 2**15) % 2**16 - 2**15, abs=500
    )
    before, after = client.of(Sip)[20:22]
    assert (after.x - before.x) % 2**16 - 2**16 == pytest.approx(-2000 * SIP_S / 0.485, abs=2)
    assert any(b.x - a.x > 60_000 for a, b in zip(client.of(Sip), client.of(Sip)[1:], strict=False)), "it wraps"
    client.send(CommandNumber.SETO)
    client.run(0.11)
    assert abs(client.sip().x) < 500


def test_wheel_speeds_in_steps_of_20_mm_s_as_two_clients_send_them() -> None:
    for raw in ("fafb06201bf6091624", "fafb06203b0af62b31"):
        client = Client().opened(motors=True)
        client.robot.receive(bytes.fromhex(raw))
        client.run(2.0, pulse_s=0.5)
        assert (client.sip().left, client.sip().right) == pytest.approx((-200, 200), abs=1)


@pytest.mark.parametrize(("argument", "turn_deg"), [(90, 90.0), (-90, -90.0), (190, -170.0)])
def test_a_heading_is_turned_to_the_short_way(argument: int, turn_deg: float) -> None:
    client = Client().opened(motors=True)
    client.send(CommandNumber.HEAD, argument)
    client.run(5.0, pulse_s=0.5)
    assert math.degrees(client.robot.truth.pose.theta) == pytest.approx(turn_deg, abs=0.5)
    assert client.twist == STILL
    client.send(CommandNumber.DHEAD, -45)
    client.run(4.0, pulse_s=0.5)
    assert math.degrees(client.robot.truth.pose.theta) == pytest.approx(turn_deg - 45.0, abs=1.0)


@pytest.mark.parametrize("way_mm", [500, -300])
def test_a_move_ends_at_its_way(way_mm: int) -> None:
    client = Client().opened(motors=True)
    client.send(CommandNumber.SETV, 200)
    client.send(CommandNumber.MOVE, way_mm)
    client.run(5.0, pulse_s=0.5)
    assert client.robot.truth.pose.x == pytest.approx(1e-3 * way_mm, abs=0.005)
    assert client.twist == STILL


def test_speeds_and_ramps_are_set_within_the_limits() -> None:
    client = Client().opened(motors=True)
    for number, value in ((CommandNumber.SETV, 9999), (CommandNumber.SETRV, 90), (CommandNumber.SETA, 1000)):
        client.send(number, value)
    for number, value in ((CommandNumber.SETA, -2000), (CommandNumber.SETRA, 200), (CommandNumber.SETRA, -9999)):
        client.send(number, value)
    client.send(CommandNumber.CONFIG)
    client.run(0.1)
    (config,) = client.of(ConfigPacket)
    assert (config.speed_max, config.turn_max, config.acceleration, config.deceleration) == (2200, 90, 1000, 2000)
    assert (config.turn_acceleration, config.turn_deceleration) == (200, 600)
    client.send(RVEL, 500)
    client.run(1.5)
    assert math.degrees(client.twist.w) == pytest.approx(90.0)
    client.send(VEL, 9999)
    client.run(1.0)
    assert client.twist.v == pytest.approx(1.0, abs=0.01)


def test_an_emergency_stop_brakes_harder_and_drops_commands_until_it_stands() -> None:
    client = Client().opened(motors=True)
    client.send(VEL, 600)
    client.run(1.9)
    begin = client.now
    client.send(CommandNumber.ESTOP)
    client.run(0.05)
    client.send(VEL, 600)
    while client.twist != STILL:
        client.run(0.005)
    assert client.now - begin == pytest.approx(0.57 / 4.0, abs=0.03)
    client.run(0.5)
    assert client.twist == STILL
    client.send(VEL, 200)
    client.run(0.5)
    assert client.twist.v > 0.1


def test_odometry_drifts_as_a_differential_base_does() -> None:
    odometry = OdometryConfig(scale=1.02, turn_scale=1.05, veer_rad_per_m=0.1)
    client = Client(WorldConfig(odometry=odometry)).opened(motors=True)
    client.send(CommandNumber.DHEAD, 90)
    client.run(4.0, pulse_s=0.5)
    turn, odom = client.robot.truth.pose.theta, client.robot._body.odometry_pose
    assert odom.theta == pytest.approx(1.05 * turn)
    for number, value in ((RVEL, 0), (CommandNumber.SETO, None), (VEL, 300)):
        client.send(number, value)
    before_m = client.robot._body.odometry_m
    client.run(4.0, pulse_s=0.5)
    odom = client.robot._body.odometry_pose
    assert odom.theta == pytest.approx(0.1 * (client.robot._body.odometry_m - before_m) / 1.02)
