"""What was sure after a drive stays while the robot stands: more readings of an unchanged room take nothing away."""

from __future__ import annotations

from collections.abc import Callable
from typing import get_args

import pytest

from bench.standing import StandTrial, try_standing
from config.load import load_settings
from perception.localization.room.expected_ranges import Reflection

SETTINGS = load_settings("room", ["perception.method=bayes"])
MODELS = get_args(Reflection)
pytestmark = [pytest.mark.compiled]
LOST_MAX = 0.02
"""Share of what was sure that may be lost within ten minutes: asked is nothing, 8 of 861 were measured."""


def losses(trial: StandTrial) -> list[str]:
    """Return what was lost, each as text."""
    return [f"{one.model} {one.ends or (one.x, one.y)} after {at} min" for one, at in trial.lost]


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("seed", [2000, 2001, 2002])
def test_nothing_sure_is_lost_while_the_robot_stands(model: Reflection, seed: int) -> None:
    trial = try_standing(SETTINGS, seed, model, 150.0)
    assert trial.known, "a drive through a room makes something sure"
    assert losses(trial) == []
    assert trial.named == set()


@pytest.mark.soak
@pytest.mark.parametrize("model", MODELS)
def test_hardly_anything_sure_is_lost_in_ten_minutes_in_a_hundred_rooms(
    model: Reflection, measured: Callable[[str], None]
) -> None:
    trials = [try_standing(SETTINGS, seed, model, 600.0) for seed in range(2100, 2200)]
    lost = [text for trial in trials for text in losses(trial)]
    measured(f"{model}: {len(lost)} of {sum(len(trial.known) for trial in trials)} sure objects lost")
    assert len(lost) <= LOST_MAX * sum(len(trial.known) for trial in trials)
    assert all(trial.named == set() for trial in trials)
