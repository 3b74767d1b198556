"""Walls along the way explain the readings of sensors at one angle to it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_settings
from drivers.messages import Floats
from runtime.recording.conventions.beams import Beams
from runtime.recording.conventions.headings import Angles
from runtime.recording.conventions.table import Table

ROWS = 200


def beams(robot: str, yaw: float) -> Beams:
    """Return the beams of a robot that drives along x while its ring looks along `yaw`."""
    x: Floats = 0.02 * np.arange(ROWS, dtype=np.float64)
    pose: Floats = np.column_stack([x, 0.0 * x, 0.0 * x, yaw + 0.0 * x])
    settings = load_settings("hallway", robot=robot)
    return Beams.of(Table(x, pose, np.ones((ROWS, settings.ring.sensor_count))), settings, Angles())


def test_bearings_count_from_the_way() -> None:
    found = beams("p3dx", 0.3)
    angles = [mount.angle_rad + 0.3 for mount in load_settings("hallway", robot="p3dx").ring.mounts]
    np.testing.assert_allclose(np.exp(1j * found.bearing), np.exp(1j * np.tile(angles, (ROWS, 1))), atol=1e-9)


@pytest.mark.parametrize("unit", [1.0, 0.01], ids=["m", "cm"])
@pytest.mark.parametrize("robot", ["p3dx", "denning"])
def test_ranges_of_two_walls_are_foreseen_and_silence_is_not(robot: str, unit: float) -> None:
    found = beams(robot, 0.0)
    nearest = np.minimum(found.off_way + found.half_angle, 0.5 * math.pi)
    away = np.where(found.bearing > 0.0, 1.2, 1.7)
    mounted = found.radius_m * np.abs(np.sin(found.bearing + found.mounted))
    ranges = np.minimum((away - mounted) / np.sin(nearest), found.range_max_m)
    is_wall = ranges < found.range_max_m
    is_wall &= np.abs(np.sin(found.bearing)) > 0.1
    shown = found.foreseen(ranges / unit)
    assert shown[is_wall].mean() > 0.9
    everywhere = np.where(nearest < 0.4 * math.pi, 0.8 * found.range_max_m, ranges)
    assert found.foreseen(everywhere / unit)[everywhere == 0.8 * found.range_max_m].mean() < 0.4


def test_one_wall_is_heard_at_one_angle() -> None:
    found = beams("p3dx", 0.0)
    inside = np.abs(np.abs(found.bearing) - 0.5 * math.pi) < 0.1
    shown = found.at_one_angle(inside, 2.0, 2.01)
    assert shown[inside].all()
    assert not shown[found.off_way < 1.0].any()


def test_the_rings_greatest_range_is_known_in_any_unit() -> None:
    found = beams("p3dx", 0.0)
    assert found.is_greatest(found.range_max_m)
    assert found.is_greatest(100.0 * found.range_max_m)
    assert not found.is_greatest(0.93 * found.range_max_m)


def test_few_rows_are_enough() -> None:
    found = beams("p3dx", 0.0)
    few = found._replace(bearing=found.bearing[:7])
    assert few.foreseen(np.ones((7, len(found.radius_m)))).shape == (7, len(found.radius_m))
