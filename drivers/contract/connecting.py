"""The contract of connecting: before the robot answers, the handshake, and any bytes at any time in any pieces."""

from __future__ import annotations

import math
import random
from collections.abc import Callable

import pytest

from drivers import registry
from drivers.contract.cable import Cable
from drivers.contract.family import Family, steps
from drivers.driver import LineState, Received
from drivers.messages import Firing, LinkCounts, Pose, Twist


def test_a_new_driver_is_closed_and_silent(family: Family) -> None:
    driver = registry.make_driver(family.robot)
    assert driver.state is LineState.CLOSED
    assert driver.outgoing(writable=True) == b""
    assert (driver.identity, driver.problem, driver.counts) == (None, None, LinkCounts())
    assert driver.odometry_origin == Pose(0.0, 0.0, 0.0)
    assert driver.firings_waiting == 0
    assert driver.take_received() == Received((), None, rebooted=False)


@pytest.mark.parametrize("twist", [Twist(math.nan, 0.0), Twist(0.0, math.inf)])
def test_a_velocity_that_is_not_finite_is_refused(family: Family, twist: Twist) -> None:
    driver = registry.make_driver(family.robot)
    with pytest.raises(ValueError, match="finite"):
        driver.drive(twist)


def test_it_identifies_the_robot_sets_its_pattern_and_is_ready(family: Family) -> None:
    cable = family.cable()
    cable.plug()
    states = [cable.driver.state]
    while states[-1] is not LineState.READY:
        cable.step()
        states.append(cable.driver.state)
        assert cable.driver.state is LineState.READY or cable.driver.firings_waiting == 0
        assert cable.now_s <= family.connect_s
    assert set(states) == {LineState.HANDSHAKE, LineState.READY}
    assert cable.driver.problem is None
    identity, link = cable.driver.identity, family.robot.link
    assert identity is not None
    assert identity.sensors == family.robot.ring.sensor_count
    assert link.deadman_min_s <= identity.deadman_s <= link.deadman_max_s
    assert identity.name
    assert cable.restarts == 0
    cable.until_echo(family.connect_s)


def test_an_unanswered_line_goes_down_with_a_reason_and_is_ready_once_the_robot_answers(family: Family) -> None:
    cable = family.cable()
    driver, run_s = cable.driver, 0.0
    driver.line_opened(run_s)
    while driver.state is LineState.HANDSHAKE:
        run_s += 0.05
        driver.tick(run_s)
        driver.outgoing(writable=True)
        assert run_s <= 12.0
    assert driver.state is LineState.DOWN
    problem = driver.problem
    assert problem is not None
    assert "\n" not in problem
    cable.plugged = True
    cable.passed = {"to the robot": 0, "to the host": 0}
    cable.steps = steps(run_s)
    cable.robot.advance(run_s)
    cable.until_state(LineState.READY, family.connect_s + 10.0)
    assert driver.problem is None


def heard(firings: list[Firing]) -> list[tuple[object, ...]]:
    """Return firings in a form that can be compared."""
    return [(f.robot_s, f.pose, f.ring_yaw, f.ranges_m.tobytes()) for f in firings]


def in_pieces_of(size: int) -> Callable[[bytes], list[bytes]]:
    return lambda data: [data[k : k + size] for k in range(0, len(data), size)]


@pytest.mark.parametrize("size", [1, 2, 7])
def test_how_bytes_are_split_makes_no_difference(family: Family, size: int) -> None:
    def run(split: Callable[[bytes], list[bytes]]) -> Cable:
        cable = family.cable()
        cable.split, cable.twist = split, family.at(0.1, 0.2)
        cable.plug()
        cable.run(family.connect_s)
        cable.driver.release()
        cable.run(0.7)
        return cable

    whole, split = run(lambda data: [data]), run(in_pieces_of(size))
    assert heard(split.firings) == heard(whole.firings)
    assert split.odometry == whole.odometry
    assert split.passed == whole.passed
    assert split.robot.truth == whole.robot.truth
    assert whole.firings


def test_a_drive_before_ready_is_not_sent(family: Family) -> None:
    cable = family.cable()
    cable.twist = Twist(0.3, 0.1)
    cable.plug()
    while cable.driver.state is not LineState.READY:
        cable.driver.drive(Twist(0.3, 0.1))
        cable.step()
    quiet = family.connected()
    assert cable.robot.truth.pose == quiet.robot.truth.pose


def test_any_bytes_are_survived_at_both_ends(family: Family) -> None:
    """Noise with pieces of valid frames, before the handshake, in the middle of it, and after it."""
    rng = random.Random(4)
    valid = bytearray()
    for at_s in (0.0, 0.3 * family.connect_s, family.connect_s, family.connect_s + 0.5):
        cable = family.cable()
        cable.plug()
        cable.run(at_s)
        valid += cable.said
        for _ in range(40):
            start = rng.randrange(len(valid) + 1)
            noise = rng.randbytes(rng.randrange(200)) + bytes(valid[start : start + rng.randrange(60)])
            cable.driver.receive(noise, cable.now_s)
            cable.robot.receive(noise)
            cable.step()
            assert cable.driver.problem is None or "\n" not in cable.driver.problem
        cable.unplug()
        cable.plug()
        cable.until_state(LineState.READY, 10.0)
        cable.until_echo(2.0)
