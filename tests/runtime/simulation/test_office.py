"""The shipped office: its goal lies behind a dead end, and the robot arrives there."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import pytest

from behaviors.move_to_goal import Goal
from config.load import load_settings
from drivers.emulator.robot_device import GroundTruth
from drivers.messages import Pose
from runtime.cycle.modes import Mode
from runtime.cycle.step import CycleRecord, State
from runtime.simulation.closed_loop import simulate

SETTINGS = load_settings("office")
SECONDS_MAX = 400.0


def drive(seed: int) -> tuple[float, float, int]:
    """Return the truth at the end of the drive: the distance to the goal, the way driven, m, and the contacts."""
    assert SETTINGS.goal is not None
    assert SETTINGS.world is not None
    path: list[Pose] = []
    contacts = 0

    def see(_record: CycleRecord, truth: GroundTruth) -> None:
        nonlocal contacts
        contacts = truth.contacts
        path.append(truth.pose)

    def is_over(state: State) -> bool:
        is_reached = isinstance(state.drive_request, Goal) and state.drive_request.reached
        return is_reached or state.mode.mode is Mode.SAFE_STOP

    result = simulate(SETTINGS, SETTINGS.world, seed, SECONDS_MAX, see, is_over=is_over)
    goal = result.start.compose(Pose(SETTINGS.goal.x_m, SETTINGS.goal.y_m, 0.0))
    way = sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in itertools.pairwise(path))
    return math.hypot(path[-1].x - goal.x, path[-1].y - goal.y), way, contacts


@pytest.mark.soak
@pytest.mark.compiled
@pytest.mark.promise("P33")
def test_the_robot_arrives_behind_the_dead_end_of_the_office(measured: Callable[[str], None]) -> None:
    ways = []
    for seed in range(10):
        off, way, contacts = drive(seed)
        assert contacts == 0, seed
        assert off < 0.5, seed
        ways.append(way)
    measured(f"10 drives: 10 arrive, 0 contacts, ways of {min(ways):.0f} to {max(ways):.0f} m")
