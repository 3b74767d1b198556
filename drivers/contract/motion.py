"""The contract of motion: nothing moves by itself, a halt stops and latches, limits hold, the base stops alone."""

from __future__ import annotations

import math

import pytest

from drivers.base_model import stop_s
from drivers.capabilities import moves_on
from drivers.contract.cable import CYCLE_STEPS, STEP_S
from drivers.contract.family import PLAIN, ROOM, Family, script, steps
from drivers.driver import LineState
from drivers.messages import Flags, Twist
from drivers.registry import deadman_s

STILL = Twist(0.0, 0.0)
RAMP_S = 0.3
"""Longest time from the deadman's end to standstill."""
LINE_S = 0.1
"""Longest time in which the last velocity gets through the line, and a base takes its ticks."""


def test_nothing_moves_without_a_command(family: Family) -> None:
    cable = family.connected()
    start = cable.robot.truth.pose
    cable.run(1.0)
    cable.driver.release()
    cable.run(1.0)
    cable.driver.set_firing(family.other_ring)
    cable.run(0.5)
    cable.unplug()
    cable.run(0.5)
    cable.plug()
    family.until_ready(cable)
    assert cable.robot.truth.pose == start


def test_it_drives_as_commanded_and_reports_it(family: Family) -> None:
    asked = family.at(0.2, 0.4)
    cable = family.driving(asked)
    cable.run(0.3)
    twist = cable.odometry[-1].twist
    assert (twist.v, twist.w) == pytest.approx((asked.v, asked.w), abs=0.02)
    assert not cable.odometry[-1].flags & Flags.LATCHED


def test_no_command_exceeds_the_limits_of_the_body(family: Family) -> None:
    cable = family.connected(world=PLAIN)
    cable.driver.release()
    cable.twist = Twist(1e9, -1e9)
    fastest = fastest_turn = 0.0
    fast = Twist(family.robot.body.speed_max_m_s, family.robot.body.turn_max_rad_s)
    for _ in range(steps(2.0 + stop_s(fast, family.robot.body))):
        cable.step()
        fastest = max(fastest, cable.robot.truth.twist.v)
        fastest_turn = max(fastest_turn, -cable.robot.truth.twist.w)
    limits = family.robot.body
    assert fastest == pytest.approx(limits.speed_max_m_s, rel=0.02)
    assert fastest_turn == pytest.approx(limits.turn_max_rad_s, rel=0.02)
    assert fastest <= limits.speed_max_m_s + 1e-9
    assert fastest_turn <= limits.turn_max_rad_s + 1e-9


@pytest.mark.promise("P29")
def test_a_halt_stops_the_base_and_holds_it_until_a_release(family: Family) -> None:
    cable = family.driving()
    cable.driver.halt()
    cable.run(family.halt_s)
    assert cable.robot.truth.twist == STILL
    stands = cable.robot.truth.pose
    cable.run(1.0)
    assert cable.robot.truth.pose == stands, "velocities are requested all the time"
    assert cable.odometry[-1].flags & Flags.LATCHED
    assert cable.driver.state is LineState.READY
    cable.driver.release()
    cable.until(lambda: cable.robot.truth.twist.v > 0.3 * family.ahead.v, 2.0, "motion after the release")
    assert not cable.odometry[-1].flags & Flags.LATCHED


def test_a_halt_goes_out_at_once_also_on_a_line_that_is_full(family: Family) -> None:
    cable = family.driving()
    for v in (0.1, 0.2):
        cable.driver.drive(Twist(v, 0.0))
        assert cable.driver.outgoing(writable=False) == b"", "a velocity would leave late"
    cable.driver.halt()
    assert cable.driver.outgoing(writable=False)


def test_of_the_velocities_that_waited_only_the_newest_is_sent(family: Family) -> None:
    several, one = family.driving(), family.driving()
    for v in (0.1, 0.2):
        several.driver.drive(Twist(v, 0.0))
        assert several.driver.outgoing(writable=False) == b""
    several.driver.drive(family.at(0.25))
    one.driver.drive(family.at(0.25))
    assert several.driver.outgoing(writable=True) == one.driver.outgoing(writable=True) != b""


@pytest.mark.parametrize("outage_s", [STEP_S, 0.1])
def test_a_halt_is_kept_for_the_next_line_and_a_velocity_is_not(family: Family, outage_s: float) -> None:
    cable = family.driving()
    cable.unplug()
    cable.driver.halt()
    cable.run(outage_s)
    cable.plug()
    cable.run(family.halt_s)
    assert cable.robot.truth.twist == STILL
    stands = cable.robot.truth.pose
    family.until_ready(cable)
    cable.run(0.5)
    assert cable.robot.truth.pose == stands


@pytest.mark.needs("deadman")
def test_a_line_that_opens_again_moves_nothing_by_itself(family: Family) -> None:
    cable = family.driving()
    cable.unplug()
    cable.driver.drive(Twist(0.3, 0.0))
    cable.twist = None
    cable.run(family.robot.link.deadman_max_s + 1.0 + stop_s(family.ahead, family.robot.body))
    stands = cable.robot.truth.pose
    assert cable.robot.truth.twist == STILL
    cable.plug()
    family.until_ready(cable)
    cable.run(1.0)
    assert cable.robot.truth.pose == stands


@pytest.mark.needs("deadman")
@pytest.mark.promise("P1")
@pytest.mark.parametrize("how", ["frozen", "unplugged"])
def test_the_base_stops_by_itself_when_the_host_is_gone(family: Family, how: str) -> None:
    cable = family.driving()
    identity = cable.driver.identity
    assert identity is not None
    if how == "frozen":
        cable.frozen = True
    else:
        cable.unplug()
    cable.run(identity.deadman_s + max(RAMP_S, stop_s(family.ahead, family.robot.body) + RAMP_S / 3.0))
    assert cable.robot.truth.twist == STILL


@pytest.mark.needs("deadman")
def test_killed_at_full_speed_it_moves_no_longer_than_check_says(family: Family) -> None:
    body = family.robot.body
    said = moves_on(body, deadman_s(family.robot))
    assert said is not None
    cable = family.driving(Twist(body.speed_max_m_s, 0.0))
    cable.run(STEP_S * CYCLE_STEPS)
    cable.frozen = True
    begins = cable.robot.truth.pose
    cable.run(said.lasts_s + LINE_S)
    stands = cable.robot.truth.pose
    assert cable.robot.truth.twist == STILL
    assert math.hypot(stands.x - begins.x, stands.y - begins.y) <= said.way_m + body.speed_max_m_s * LINE_S


@pytest.mark.parametrize(
    ("kind", "flag"),
    [
        pytest.param("bumper", Flags.BUMPER, marks=pytest.mark.needs("bumper")),
        pytest.param("motor_fault", Flags.MOTOR_FAULT, marks=pytest.mark.needs("motor_fault")),
        pytest.param("stop_button", Flags.LATCHED, marks=pytest.mark.needs("stop_button")),
        pytest.param("low_battery", Flags.BATTERY_LOW, marks=pytest.mark.needs("battery")),
    ],
)
def test_what_is_wrong_with_the_base_is_reported_and_over_when_it_is(family: Family, kind: str, flag: Flags) -> None:
    at_s = family.connect_s + 3.0
    cable = family.driving(None, *script(kind=kind, at_s=at_s, duration_s=0.5))
    assert not cable.odometry[-1].flags & flag
    cable.run(at_s + 0.2 - cable.now_s)
    assert cable.odometry[-1].flags & flag
    if kind == "stop_button":
        assert cable.robot.truth.twist == STILL
        cable.driver.release()
        cable.run(0.2)
        assert cable.robot.truth.twist == STILL
    cable.driver.halt()
    cable.run(0.6)
    cable.driver.release()
    cable.until(lambda: cable.robot.truth.twist.v > 0.3 * family.ahead.v, 3.0, "motion after the fault")
    cable.run(0.2)
    assert not cable.odometry[-1].flags & flag


def test_the_voltage_of_the_battery_is_the_last_reported(family: Family) -> None:
    cable = family.cable(*script(kind="low_battery", at_s=family.connect_s + 1.0, duration_s=1.0))
    assert cable.driver.battery_v is None
    cable.plug()
    family.until_ready(cable)
    expected = family.volts
    assert cable.driver.battery_v == (expected and pytest.approx(expected[0], abs=0.01))
    cable.run(family.connect_s + 1.5 - cable.now_s)
    assert cable.driver.battery_v == (expected and pytest.approx(expected[1], abs=0.01))


@pytest.mark.needs("bumper")
def test_driven_into_a_wall_it_reports_the_contact(family: Family) -> None:
    cable = family.connected(world=ROOM)
    cable.driver.release()
    cable.twist = family.ahead
    cable.until(lambda: cable.robot.truth.contacts > 0, 4.0 / family.ahead.v, "contact")
    cable.run(0.2)
    assert cable.flags & (Flags.BUMPER | Flags.MOTOR_FAULT)
    cable.driver.halt()
    cable.run(0.5)
    assert cable.robot.truth.twist == STILL
    assert math.isclose(cable.robot.truth.pose.x, 2.5 - family.robot.body.radius_m, abs_tol=1e-3)
