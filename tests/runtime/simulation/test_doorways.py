"""A doorway of 1.1 m in a wall between the robot and its goal: it is passed, and nothing is touched."""

from __future__ import annotations

import math
from typing import Final, Literal

import numpy as np
import pytest

from behaviors.move_to_goal import Goal
from config.load import load_settings
from config.settings import GoalConfig
from config.world import AcousticsConfig, OdometryConfig, StartConfig, WallConfig, WorldConfig
from drivers.emulator.robot_device import GroundTruth
from drivers.messages import Pose
from runtime.cycle.modes import Mode
from runtime.cycle.step import CycleRecord, State
from runtime.simulation.closed_loop import simulate

SETTINGS: Final = load_settings("hallway")
WIDTH_M: Final = 1.1
THICK_M: Final = 0.15
BESIDE_M: Final = 8.0
"""The wall goes on so far on either side: no way round it is shorter than the one through."""
PASSED_MIN: Final = 0.5
"""Share of the drives that lead through; the others go round the wall."""
Model = Literal["cone", "specular"]


def wall(width_m: float) -> tuple[WallConfig, ...]:
    """Return a wall along y with a doorway in its middle, both faces and the posts."""
    half = 0.5 * width_m
    lines = []
    for side in (1.0, -1.0):
        lines += [(x, side * half, x, side * BESIDE_M) for x in (0.0, THICK_M)]
        lines.append((0.0, side * half, THICK_M, side * half))
    return tuple(WallConfig(x1_m=a, y1_m=b, x2_m=c, y2_m=d) for a, b, c, d in lines)


def drive(model: Model, start: Pose, goal: tuple[float, float], seed: int) -> tuple[float, float, int]:
    """Return the truth at the end of a drive: the distance to the goal, the way driven, m, and the contacts."""
    world = WorldConfig(
        wall=wall(WIDTH_M),
        start=StartConfig(x_m=start.x, y_m=start.y, heading_deg=math.degrees(start.theta)),
        acoustics=AcousticsConfig(model=model, noise_relative=0.01, dropout=0.05, outliers=0.03),
        odometry=OdometryConfig(scale=1.01, heading_rad_per_sqrt_m=math.radians(0.3)),
    )
    ahead = start.inverse().compose(Pose(*goal, 0.0))
    settings = SETTINGS.model_copy(update={"goal": GoalConfig(x_m=ahead.x, y_m=ahead.y), "world": world})
    at, way, contacts = start, 0.0, 0

    def see(_record: CycleRecord, truth: GroundTruth) -> None:
        nonlocal at, way, contacts
        way += math.hypot(truth.pose.x - at.x, truth.pose.y - at.y)
        at, contacts = truth.pose, truth.contacts

    def is_over(state: State) -> bool:
        is_reached = isinstance(state.drive_request, Goal) and state.drive_request.reached
        return is_reached or state.mode.mode is Mode.SAFE_STOP

    simulate(settings, world, seed, 60.0, see, is_over=is_over)
    return math.dist((at.x, at.y), goal), way, contacts


@pytest.mark.compiled
@pytest.mark.parametrize("model", [pytest.param("cone", marks=pytest.mark.soak), "specular"])
def test_a_doorway_of_1_1_m_is_passed(model: Model) -> None:
    off, way, contacts = drive(model, Pose(-1.4, -0.3, 0.1), (0.9, 0.2), 1)
    assert off < 0.3
    assert way < 2.5 * math.dist((-1.4, -0.3), (0.9, 0.2))
    assert contacts == 0


@pytest.mark.soak
@pytest.mark.compiled
@pytest.mark.parametrize("model", ["cone", "specular"])
def test_doorways_of_1_1_m_are_passed_on_most_ways_and_never_touched(model: Model) -> None:
    passed, drives = 0, 20
    for seed in range(drives):
        rng = np.random.default_rng([seed, 53])
        (y, goal_y), x, goal_x = rng.uniform(-1.0, 1.0, 2).tolist(), -rng.uniform(1.5, 3.0), rng.uniform(1.2, 2.5)
        theta = math.atan2(goal_y - y, goal_x - x) + rng.uniform(-0.35, 0.35)
        off, way, contacts = drive(model, Pose(x, y, theta), (goal_x, goal_y), seed)
        assert contacts == 0, seed
        passed += off < 0.5 and way < 2.0 * BESIDE_M
    assert passed >= PASSED_MIN * drives
