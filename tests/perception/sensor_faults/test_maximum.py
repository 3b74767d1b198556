"""A greatest range in all directions, and never a silence, stands for a silence; an honest ring keeps its echoes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_robot
from drivers.messages import Firing, Pose
from perception.sensor_faults.monitor import SensorMonitor

RING = load_robot("parking12").ring
COUNT, MOST_M = len(RING.mounts), RING.range_max_m


def firing(k: int, pose: Pose, ranges_m: list[float]) -> Firing:
    return Firing(0.06 * k, pose, pose.theta, np.array(ranges_m))


def reports(watch: SensorMonitor) -> dict[int, str]:
    return {report.sensor: report.fault for report in watch.reports()}


def test_the_maximum_in_four_directions_is_a_silence_until_one_is_reported() -> None:
    watch, here = SensorMonitor(RING), Pose(1.0, 2.0, 0.5)
    alternately = [MOST_M if i % 2 else 2.0 for i in range(COUNT)]
    trusted, possible = watch.filter(firing(0, here, alternately))
    named = reports(watch)
    assert len(named) >= 2
    assert set(named.values()) == {"at_maximum"}
    assert "taken for silence" in watch.reports()[0].reason
    trusted, possible = watch.filter(firing(1, here, alternately))
    assert (
        trusted.ranges_m.tolist() == possible.ranges_m.tolist() == [math.inf if i % 2 else 2.0 for i in range(COUNT)]
    )
    for k in range(2, 4):
        watch.filter(firing(k, here, [math.inf if i % 2 else 2.0 for i in range(COUNT)]))
    assert reports(watch) == {}
    assert watch.filter(firing(4, here, [MOST_M] + [2.0] * (COUNT - 1)))[0].ranges_m[0] == MOST_M


@pytest.mark.parametrize("turned_rad", [0.0, 0.01])
def test_a_wall_at_the_end_of_the_range_is_an_echo(turned_rad: float) -> None:
    """Of a wall ahead and one behind, along which the robot also drives, the ring hears one range for long."""
    watch = SensorMonitor(RING)
    for k in range(400):
        pose = Pose(0.0, 0.01 * k, turned_rad * k)
        axes = [math.remainder(pose.theta + mount.angle_rad, math.pi) for mount in RING.mounts]
        ranges = [MOST_M if abs(axis) < math.radians(24.0) else 2.0 for axis in axes]
        assert watch.filter(firing(k, pose, ranges))[0].ranges_m.tolist() == ranges
    assert reports(watch) == {}


@pytest.mark.covered
def test_a_ring_that_also_reports_silence_is_believed() -> None:
    watch, rng = SensorMonitor(RING), np.random.default_rng(4)
    for k in range(2_000):
        ranges = rng.choice([MOST_M, 1.0, math.inf], COUNT, p=[0.002, 0.898, 0.1]).tolist()
        watch.filter(firing(k, Pose(0.02 * k, 0.0, 0.05 * k), ranges))
        assert "at_maximum" not in reports(watch).values()
