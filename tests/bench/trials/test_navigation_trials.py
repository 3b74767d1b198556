"""Drives to goals across random rooms: the robot arrives, touches nothing, and gives up where no way leads."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest

from behaviors.move_to_goal import Goal
from bench.trials.navigation_trials import (
    ACOUSTICS,
    ODOMETRY,
    OurCycle,
    Trial,
    TrialResult,
    figures,
    random_trial,
    run_trial,
)
from config.load import load_settings
from config.settings import Settings
from config.world import DrumConfig, WallConfig, WorldConfig


@pytest.mark.compiled
@pytest.mark.parametrize("rooms", [(703,), pytest.param(range(700, 760), marks=pytest.mark.soak)])
def test_it_arrives_across_random_rooms_and_touches_nothing(rooms: Sequence[int]) -> None:
    settings = load_settings("hallway", ["perception.method=paper", "perception.grid.method=directed"])
    trials = [random_trial(seed, settings) for seed in rooms]
    results = [run_trial(trial, settings, OurCycle, seed) for seed, trial in enumerate(trials)]
    row = figures(trials, results, settings.behaviors.arbiter.base_velocity_m_s)
    assert row["touched"] == 0
    assert row["arrives_pct"] >= 98.0
    assert row["way_mean"] <= 1.25
    assert row["speed_share"] >= 0.7


@pytest.mark.soak
@pytest.mark.compiled
def test_a_goal_inside_a_drum_is_given_up_and_the_robot_stands() -> None:
    """The drive ends by itself with the reason; the same drive gives the same bits."""
    drum = DrumConfig(x_m=2.0, y_m=0.1, radius_m=0.35)
    wall = WallConfig(x1_m=-3.0, y1_m=-3.0, x2_m=-3.0, y2_m=3.0)
    world = WorldConfig(drum=(drum,), wall=(wall,), acoustics=ACOUSTICS, odometry=ODOMETRY)
    trial = Trial(world, (2.0, 0.1), 2.0)
    settings = load_settings("hallway", ["perception.method=paper", "behaviors.move_to_goal.stuck_after_s=5.0"])
    said: list[str | None] = []

    def watched(settings: Settings, goal: Goal) -> OurCycle:
        return OurCycle(settings, goal, lambda _, state: said.append(state.hold_reason))

    result = run_trial(trial, settings, watched, 1)
    assert (result.outcome, result.contacts) == ("gave up", 0)
    assert (said[-1] or "").startswith("the goal is unreachable: something stands there")
    assert result.drive_s < 40.0
    assert run_trial(trial, settings, watched, 1) == result


def test_figures_count_what_became_of_the_drives() -> None:
    trial = Trial(WorldConfig(), (3.0, 0.0), 3.0)
    good = TrialResult("arrived", 0, 3.6, 15.0, 7.2, 0.2)
    row = figures([trial] * 4, [good, good, TrialResult("gave up", 1, 9.0, 60.0, 9.0, 0.0), good], 0.3)
    assert (row["arrives_pct"], row["touched"], row["gave_up"]) == (75.0, 1, 1)
    assert row["way_mean"] == pytest.approx(1.2)
    assert row["speed_share"] == pytest.approx(0.8)
    assert row["jerk_rad_s_per_m"] == pytest.approx(2.0)
    assert math.isclose(row["clearance_min_m"], 0.2)
