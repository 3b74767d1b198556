"""The wall along the path that explains why a sensor repeats its reading."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.kernel import Floats
from perception.records import records, zeros
from perception.sensor_faults.memory import RingSetup, SensorMemory
from perception.sensor_faults.wall import BESIDE_MIN_M, beside_m, is_along_wall

HALF = math.radians(12.0)
RADIUS_M = 0.381
AXES = np.radians([30.0, 45.0, 15.0])
MOUNTS: Floats = np.column_stack([RADIUS_M * np.cos(AXES), RADIUS_M * np.sin(AXES), AXES])
NEIGHBOURS = np.array([[1, 2], [-1, -1], [-1, -1]])


def heard_m(axis: float, wall_m: float) -> float:
    """Return the range at which a rough wall along x answers: from the beam's edge that is nearer to its normal."""
    nearest = min(max(0.5 * math.pi, axis - HALF), axis + HALF)
    return (wall_m - RADIUS_M * math.sin(axis)) / math.sin(nearest)


@pytest.mark.parametrize("axis_deg", [10.0, 45.0, 80.0, 100.0, 150.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_distance_of_a_wall_is_that_which_gives_the_range(axis_deg: float, side: float) -> None:
    axis = math.radians(axis_deg)
    mount = np.array([RADIUS_M * math.cos(axis), side * RADIUS_M * math.sin(axis), side * axis])
    assert beside_m(heard_m(axis, 1.3), 0.0, side, mount, HALF) == pytest.approx(1.3)


@pytest.mark.parametrize(
    ("neighbour_m", "moved_m", "explains"),
    [(1.0, 0.6, True), (1.5, 0.6, False), (math.inf, 0.6, False), (1.0, 0.9 * BESIDE_MIN_M, False)],
)
def test_a_neighbour_must_hear_the_same_wall_and_the_robot_must_have_moved(
    neighbour_m: float, moved_m: float, explains: bool
) -> None:
    memory = records(SensorMemory, zeros(SensorMemory, 3))
    memory[0].run_m = heard_m(float(AXES[0]), 1.0)
    memory[1].steady_m = heard_m(float(AXES[1]), neighbour_m)
    memory[2].steady_m = math.inf
    setup = RingSetup(
        MOUNTS, np.zeros(3), NEIGHBOURS, np.ones(3, np.bool_), HALF, 0.03, least=0.1, near=3.0, last_step=(6.65, 6.68)
    )
    assert is_along_wall(0, moved_m, 0.0, 0.0, 0.0, setup, memory) == explains
