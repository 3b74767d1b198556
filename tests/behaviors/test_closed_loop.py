"""Closed loop: both schemas and the arbiter with the shipped settings drive in the simulator of `hall.py`."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.behaviors import ArbiterConfig, AvoidStaticObstacleConfig, BehaviorsConfig, MoveAheadConfig
from perception.percept import Pose
from tests.behaviors.hall import FOOT, STEP_S, Run, World, drive, hallway

SHIPPED = BehaviorsConfig()
START = Pose(-1.83, 0.0, 0.0)
END_M = 9.0 * FOOT
IRREGULAR = 0.4 * FOOT


def reaches_the_end(run: Run, within_s: float) -> None:
    """Assert that the drive reached the end of the hall without touching anything and without stopping."""
    assert run.clearance > 0.1
    through = next((i for i, pose in enumerate(run.path) if pose.x >= END_M), None)
    assert through is not None, f"still at {run.path[-1]}"
    assert through * STEP_S < within_s
    assert min(run.speeds[round(3.0 / STEP_S) : through]) > 0.05


@pytest.mark.parametrize("wide", [False, True], ids=["pencil beams", "cones"])
def test_straight_down_the_papers_hallway(wide: bool) -> None:
    run = drive(hallway(), START, SHIPPED, 20.0, wide=wide)
    reaches_the_end(run, within_s=18.0)
    assert max(abs(pose.y) for pose in run.path) < 0.05
    assert run.clearance > 0.45


@pytest.mark.compiled
@pytest.mark.parametrize("seed", range(3))
def test_down_an_irregular_hallway_with_noise(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shifts = tuple((float(dx), float(dy)) for dx, dy in rng.uniform(-IRREGULAR, IRREGULAR, (6, 2)))
    reaches_the_end(drive(hallway(shifts), START, SHIPPED, 22.0, wide=True, noise=rng), within_s=22.0)


@pytest.mark.parametrize(("y", "theta"), [(0.4, 0.5), (-0.4, -0.5), (0.0, 3.0), (0.3, -1.5)])
def test_from_a_crooked_start(y: float, theta: float) -> None:
    run = drive(hallway(), Pose(START.x, y, theta), SHIPPED, 24.0)
    assert run.clearance > 0.1
    assert run.path[-1].x > END_M
    assert abs(run.path[-1].y) < 0.1


@pytest.mark.compiled
def test_around_two_drums_in_the_way() -> None:
    world = World(((1.0, 0.25, FOOT), (3.0, -0.25, FOOT)))
    run = drive(world, START, SHIPPED, 40.0, wide=True)
    assert run.clearance > 0.1
    assert run.path[-1].x > 4.0


@pytest.mark.parametrize("noisy", [False, True])
@pytest.mark.parametrize("speed", [0.3, 0.6])
def test_it_stops_before_a_wall_ahead(noisy: bool, speed: float) -> None:
    config = SHIPPED.model_copy(update={"arbiter": ArbiterConfig(base_velocity_m_s=speed)})
    world = World(walls=((2.0, -3.0, 2.0, 3.0),))
    run = drive(
        world, Pose(0.0, 0.0, 0.0), config, 20.0, wide=noisy, noise=np.random.default_rng(5) if noisy else None
    )
    assert run.clearance > 0.1
    assert run.clearance < SHIPPED.avoid_static_obstacle.avoid_obstacle_sphere_m
    if not noisy:
        assert abs(run.speeds[-1]) < 0.02


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(k, marks=pytest.mark.soak) for k in (2, 3))])
@pytest.mark.parametrize("summing", ["largest", "sum"])
def test_touches_nothing_in_clutter(seed: int, summing: str) -> None:
    rng = np.random.default_rng(seed)
    discs: list[tuple[float, float, float]] = []
    while len(discs) < 10:
        x, y, r = float(rng.uniform(-1.0, 6.0)), float(rng.uniform(-2.0, 2.0)), float(rng.uniform(0.15, 0.5))
        if math.hypot(x - START.x, y - START.y) - r > 0.7:
            discs.append((x, y, r))
    avoid = SHIPPED.avoid_static_obstacle.model_copy(update={"summing": summing})
    config = BehaviorsConfig(avoid_static_obstacle=avoid, arbiter=ArbiterConfig(base_velocity_m_s=0.45))
    run = drive(World(tuple(discs)), START, config, 12.0, wide=True, noise=rng if seed % 2 else None)
    assert run.clearance > 0.1


def test_drives_back_and_forth() -> None:
    config = BehaviorsConfig(move_ahead=MoveAheadConfig(distance_m=2.0, at_end="turn_back"))
    run = drive(World(), Pose(0.0, 0.0, 0.0), config, 40.0)
    assert 2.0 < max(pose.x for pose in run.path) < 2.5
    assert -0.5 < min(pose.x for pose in run.path[600:]) < 0.05


def test_stops_at_the_configured_distance() -> None:
    config = BehaviorsConfig(move_ahead=MoveAheadConfig(distance_m=1.0))
    run = drive(World(), Pose(0.0, 0.0, 0.0), config, 6.0)
    assert 1.0 <= run.path[-1].x < 1.15
    assert run.speeds[-1] == pytest.approx(0.0, abs=1e-9)


def test_the_least_range_of_the_ring_is_inside_the_safety_margin() -> None:
    """An object at the rim reads as half a foot or one step more; the push must be unbounded there."""
    avoid, arbiter = AvoidStaticObstacleConfig(), ArbiterConfig()
    assert avoid.avoid_obstacle_safety_margin_m > 0.6 * FOOT
    assert arbiter.clearance_m > 0.5 * FOOT
