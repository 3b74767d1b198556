"""The contract of measuring: firings by pattern, in order and in metres; odometry without wraps or jumps."""

from __future__ import annotations

import itertools
import math
import random
from dataclasses import replace

import numpy as np
import pytest

from config.robot import RingConfig
from drivers.contract.cable import Cable
from drivers.contract.family import PLAIN, ROOM, Family, is_near, ring_with, script
from drivers.driver import LineState
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import FiringError, firing_pattern, sensors
from drivers.messages import Firing, Twist
from drivers.registry import make_device

FAST_M_S = 2.0


def fired(firing: Firing) -> tuple[int, ...]:
    """Return the sensors of a firing."""
    return tuple(int(k) for k in np.flatnonzero(~np.isnan(firing.ranges_m)))


def sets_of(ring: RingConfig) -> set[tuple[int, ...]]:
    return {sensors(mask) for mask in firing_pattern(ring).masks}


def test_firings_follow_the_pattern_and_their_times_grow(family: Family) -> None:
    cable = family.connected()
    cable.run(0.2)
    cable.firings.clear()
    pattern = firing_pattern(family.robot.ring)
    rotation_s = pattern.cycle_s
    cable.run(2.0 * rotation_s + 0.2)
    times = [firing.robot_s for firing in cable.firings]
    assert all(b > a for a, b in itertools.pairwise(times))
    if "stamps" not in family.lacks:
        assert (times[-1] - times[0]) / (len(times) - 1) == pytest.approx(pattern.step_period_s, rel=0.05)
    assert {fired(firing) for firing in cable.firings} == sets_of(family.robot.ring)


def test_ranges_are_those_of_the_world_in_metres(family: Family) -> None:
    cable = family.connected(*script(kind="odometry_jump", at_s=0.0))
    cable.run(1.0)
    ring, world = family.robot.ring, ROOM
    truth = cable.robot.truth
    echoes = Sonar(ring, compile_scene(world), world.acoustics, np.random.default_rng(1))
    expected = echoes.fire(truth.pose, truth.ring_yaw)
    for firing in cable.firings:
        for sensor in fired(firing):
            assert firing.ranges_m[sensor] == pytest.approx(expected[sensor], abs=0.5 * ring.resolution_m + 2e-3)
            assert ring.range_min_m - 1e-9 <= firing.ranges_m[sensor] <= ring.window_m + 1e-9
    empty = family.connected(world=PLAIN)
    assert all(math.isinf(r) for firing in empty.firings for r in firing.ranges_m if not math.isnan(r))


@pytest.mark.needs("pattern")
def test_the_pattern_changes_while_it_drives_and_an_impossible_one_leaves_it(family: Family) -> None:
    slowly = family.at(0.1, 0.1)
    cable = family.driving(slowly)
    impossible = ring_with(family.robot.ring, sets=((len(family.robot.ring.mounts),),))
    with pytest.raises(FiringError):
        cable.driver.set_firing(impossible)
    cable.driver.set_firing(family.other_ring)
    cable.run(1.0)
    assert cable.driver.state is LineState.READY
    cable.firings.clear()
    cable.run(2.0)
    assert {fired(firing) for firing in cable.firings} == sets_of(family.other_ring)
    assert is_near(cable.robot.truth.twist, slowly)
    cable.unplug()
    cable.plug()
    family.until_ready(cable)
    cable.run(0.5)
    cable.firings.clear()
    cable.run(2.0)
    assert {fired(firing) for firing in cable.firings} == sets_of(family.other_ring), "kept for the next line"


def assert_continuous(cable: Cable) -> None:
    """No sample is farther from the last one than the base can have driven."""
    body = cable.config.body
    for a, b in itertools.pairwise(cable.odometry):
        dt_s = b.robot_s - a.robot_s
        assert dt_s > 0.0
        assert math.hypot(b.pose.x - a.pose.x, b.pose.y - a.pose.y) <= body.speed_max_m_s * dt_s + 0.01
        assert abs(b.pose.theta - a.pose.theta) <= body.turn_max_rad_s * dt_s + 0.02
        assert abs(b.ring_yaw - a.ring_yaw) <= body.turn_max_rad_s * dt_s + 0.02


def test_odometry_follows_the_truth_over_many_turns_and_wraps_nowhere(family: Family) -> None:
    asked = family.at(0.4, 1.0)
    cable = family.driving(asked)
    cable.run(14.0 / asked.w)
    truth, odometry = cable.robot.truth, cable.odometry[-1]
    assert truth.pose.theta > 4.0 * math.pi
    lag_s = 0.15
    assert odometry.pose.theta == pytest.approx(truth.pose.theta, abs=0.02 + 1.0 * lag_s)
    assert math.dist((odometry.pose.x, odometry.pose.y), (truth.pose.x, truth.pose.y)) <= 0.02 + 0.4 * lag_s
    expected_yaw = truth.ring_yaw
    assert odometry.ring_yaw == pytest.approx(expected_yaw, abs=0.02 + 1.0 * lag_s)
    assert_continuous(cable)


@pytest.mark.compiled
def test_odometry_wraps_nowhere_on_a_long_way(family: Family) -> None:
    """A counter of 16 bits overflows on it more than once."""
    fast = family.robot.body.model_copy(update={"speed_max_m_s": FAST_M_S, "acceleration_max_m_s2": FAST_M_S})
    family = replace(family, robot=family.robot.model_copy(update={"body": fast}))
    cable = family.driving(Twist(-FAST_M_S, 0.0))
    cable.run(20.0)
    truth, odometry = cable.robot.truth, cable.odometry[-1]
    assert truth.pose.x < -39.0
    assert odometry.pose.x == pytest.approx(truth.pose.x, abs=0.05 + 0.15 * FAST_M_S)
    assert_continuous(cable)


@pytest.mark.needs("stamps")
def test_firings_lie_on_the_way_that_was_driven(family: Family) -> None:
    cable = family.driving()
    cable.firings.clear()
    cable.run(1.5)
    places = [firing.pose.x for firing in cable.firings]
    assert all(b > a for a, b in itertools.pairwise(places))
    speeds = [(b.pose.x - a.pose.x) / (b.robot_s - a.robot_s) for a, b in itertools.pairwise(cable.firings)]
    assert np.median(speeds) == pytest.approx(family.ahead.v, rel=0.1)
    assert max(abs(firing.pose.y) for firing in cable.firings) < 0.01


def test_a_jump_of_the_odometry_does_not_move_the_pose(family: Family) -> None:
    jump = script(kind="odometry_jump", at_s=family.connect_s + 4.0, dx_m=1.5, dheading_rad=0.5)
    cable = family.driving(None, *jump)
    cable.run(family.connect_s + 5.0 - cable.now_s)
    assert_continuous(cable)
    assert len(cable.notes) >= 1
    assert all("\n" not in note for note in cable.notes)


def test_the_device_is_the_same_for_the_same_seed_however_time_is_split(family: Family) -> None:
    """A conversation is recorded and repeated, the robot's time in other pieces; another seed flips other bits."""
    reference = family.cable(*script(kind="bit_errors", at_s=0.5, duration_s=0.5, rate=1e-2))
    reference.plug()
    reference.twist = family.at(0.1, 0.2)
    reference.run(1.5)
    assert repeated(family, reference, seed=1) == bytes(reference.said)
    assert repeated(family, reference, seed=2) != bytes(reference.said)


def repeated(family: Family, reference: Cable, seed: int) -> bytes:
    """Return what a robot of this seed says to what another one heard."""
    rng, robot, before_s = random.Random(2), make_device(family.robot, ROOM, seed, faults=reference.faults), 0.0
    said = b""
    for at_s, data in reference.heard:
        for share in sorted(rng.random() for _ in range(rng.randrange(3))):
            said += robot.advance(before_s + share * (at_s - before_s))
        said += robot.advance(at_s)
        robot.receive(data)
        before_s = at_s
    return said
