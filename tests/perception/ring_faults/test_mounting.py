"""How a ring is mounted: what the motion excludes, and where echoes come from if it is turned."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_settings
from config.world import WallConfig, WorldConfig
from drivers.messages import Firing, Pose
from perception.kernel import Floats
from perception.records import records
from perception.ring_faults.memory import EVIDENCE_NAT, QUARTERS, EchoTrace, RingTrace
from perception.ring_faults.monitor import RingMonitor
from perception.ring_faults.motion_tests import NOTHING, STUCK_SENSOR
from perception.ring_faults.mounting import DOUBTED_NAT, ECHO_KEPT_M, EXCLUDED_NAT, possible_places
from perception.snapshot import put_back, snapshot_of
from tests.perception.ring_faults.test_monitor import CLEAN, SPEED_M, firings
from tests.perception.ring_faults.test_motion_tests import COUNT, MOUNTS, Ring, after, honest


def excluded(ring: Ring) -> list[int]:
    """Return the quarters that are excluded."""
    return [k + 1 for k, nats in enumerate(ring.memory["excluded_nat"][0].tolist()) if nats >= EXCLUDED_NAT]


def places(ring: Ring) -> Floats:
    found, echoes = np.zeros((len(ring.mounts) * QUARTERS, 2)), records(EchoTrace, ring.echoes)
    return found[: possible_places(ring.mounts, np.zeros(2), echoes, records(RingTrace, ring.memory), found)]


def between_walls(y: float, quarter: int = 0) -> Floats:
    """Return what a ring between two walls along the path hears, if it hears only what is square to it."""
    bearings = np.remainder(MOUNTS[:, 2] + 0.5 * math.pi * quarter, math.tau)
    left, right = np.abs(bearings - 0.5 * math.pi) < 0.2, np.abs(bearings - 1.5 * math.pi) < 0.2
    return np.where(left, 0.8 - y, np.where(right, 0.8 + y, math.inf))


def test_the_motion_of_an_honest_ring_excludes_all_turned_mountings_for_good() -> None:
    ring = after(0.5)
    assert excluded(ring) == [1, 2, 3]
    assert len(places(ring)) == 0
    for _ in range(30):  # a ring that is turned later does not take that back
        ring.fire(honest(ring.x, 1))
    assert excluded(ring) == [1, 2, 3]


@pytest.mark.parametrize("quarter", [1, 2, 3])
def test_a_ring_that_is_turned_is_doubted_before_it_is_named(quarter: int) -> None:
    ring, found = Ring(), NOTHING
    while ring.x < 2.0 and found in {NOTHING, *range(STUCK_SENSOR, STUCK_SENSOR + COUNT)}:
        found = ring.fire(honest(ring.x, quarter))
        if ring.memory["turned_nat"].max() >= DOUBTED_NAT:
            break
    assert int(ring.memory["turned_nat"][0].argmax()) == quarter - 1
    assert quarter not in excluded(ring)
    assert ring.x < 0.4


def test_walls_along_the_path_exclude_quarters_and_cannot_tell_a_half() -> None:
    ring, rng = Ring(), np.random.default_rng(1)
    while ring.x < 1.0:
        ring.fire(between_walls(0.0) * rng.normal(1.0, 0.01, COUNT))
    assert excluded(ring) == [1, 3]
    assert abs(ring.memory["excluded_nat"][0][1]) < EXCLUDED_NAT
    assert np.abs(places(ring)[:, 1]).min() == pytest.approx(0.8, abs=0.1)


def test_an_echo_is_where_a_turned_ring_would_have_heard_it() -> None:
    """Also after the ring has moved on and hears nothing more."""
    ring = Ring(np.array([[0.2, 0.1, math.radians(30.0)]]))
    ring.yaw = 0.4
    ring.fire(np.array([1.0]))
    place = complex(0.2 + math.cos(math.radians(30.0)), 0.1 + math.sin(math.radians(30.0)))
    for _ in range(5):
        expected = [place * np.exp(1j * (0.4 + 0.5 * math.pi * k)) for k in (1, 2, 3)]
        np.testing.assert_allclose(places(ring), [[one.real, one.imag] for one in expected])
        ring.fire(np.array([math.inf]))
    while ring.x < ECHO_KEPT_M + 0.1:
        ring.fire(np.array([math.inf]))
    assert len(places(ring)) == 0


@pytest.mark.parametrize(
    "robot", ["p3dx", *(pytest.param(robot, marks=pytest.mark.covered) for robot in ("amigo", "magellan"))]
)
def test_an_honest_robot_that_winds_between_rough_walls_is_never_doubted(robot: str) -> None:
    """Such walls lean to the path, and sensors one behind the other hear them in other distances."""
    ring, x, y, path = load_settings("room", robot=robot).ring, 0.0, 0.0, list[tuple[float, float, float]]()
    for k in range(1200):
        yaw = 0.22 * math.sin(k / 24.0)
        x, y = x + 0.5 * SPEED_M * math.cos(yaw), y + 0.5 * SPEED_M * math.sin(yaw)
        path.append((x, y, yaw))
    walls = tuple(WallConfig(x1_m=-9.0, y1_m=side, x2_m=60.0, y2_m=side) for side in (-0.5, 0.5))
    monitor = RingMonitor(ring)
    for _, firing in firings(ring, WorldConfig(wall=walls, acoustics=CLEAN), path, seed=0):
        monitor.observe(firing)
        assert not monitor.is_doubted
    assert float(monitor._ring["turned_nat"].max()) < 0.1 * EVIDENCE_NAT
    assert float(monitor._ring["excluded_nat"].min()) >= -EXCLUDED_NAT  # no more than the other way round


@pytest.mark.covered
def test_what_may_be_ahead_is_the_same_to_the_bit_after_a_restore() -> None:
    """With a part of the ring that turns: how it stands is not in a snapshot."""
    ring, rng = load_settings("room", robot="b21r-both").ring, np.random.default_rng(0)
    monitor, other = RingMonitor(ring), RingMonitor(ring)
    for k in range(40):
        ranges = rng.uniform(0.5, 3.0, len(ring.mounts))
        monitor.observe(Firing(0.05 * k, Pose(0.005 * k, 0.002 * k, 0.01 * k), 0.0, ranges))
        put_back(other, snapshot_of(monitor))
        assert len(monitor.possible_obstacles()) > 0
        np.testing.assert_array_equal(monitor.possible_obstacles(), other.possible_obstacles())
