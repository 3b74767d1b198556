"""What was sure after a drive stays while the robot stands: more readings of an unchanged room take nothing away."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import get_args

import pytest

from bench.standing import StandTrial, ring_of_room, try_standing
from config.load import load_settings
from config.world import AcousticsConfig
from perception.localization.room.expected_ranges import Reflection
from perception.pipeline import Perception
from tests.perception.wandering import Wandering

SETTINGS = load_settings("room", ["perception.method=bayes"])
MODELS = get_args(Reflection)
pytestmark = [pytest.mark.compiled]
SETTLED_S = 5.0
"""After this every sensor has fired from where the robot stopped, and all readings are refined."""
LOST_MAX = 0.005
"""Share of what was sure that may be lost within ten minutes: asked is nothing, 2 of 1,224 were measured."""


def losses(trial: StandTrial) -> list[str]:
    """Return what was lost, each as text."""
    return [f"{one.model} {one.ends or (one.x, one.y)} after {at} min" for one, at in trial.lost]


@pytest.mark.parametrize(
    ("seed", "model"),
    [
        (2000, "cone"),
        *(pytest.param(*both, marks=pytest.mark.soak) for both in itertools.product([2000, 2001, 2002], MODELS)),
    ],
)
def test_nothing_sure_is_lost_while_the_robot_stands(seed: int, model: Reflection) -> None:
    trial = try_standing(SETTINGS, seed, model, 150.0, settle_s=SETTLED_S)
    assert trial.known, "a drive through a room makes something sure"
    assert losses(trial) == []
    assert trial.named == set()


@pytest.mark.parametrize(
    ("seed", "model"),
    [
        (301, "specular"),  # a span of a wall comes near a circle's, …
        (306, "cone"),  # … or walls end a little farther from their corner, …
        (310, "cone"),  # … or a stray passes where a wall goes on to its corner, …
        (401, "specular"),  # … or two echoes of a drum drop out
        *(pytest.param(*both, marks=pytest.mark.soak) for both in itertools.product([2003, 2004], MODELS)),
    ],
)
def test_the_last_readings_of_a_drive_take_no_wall_and_no_drum_away(seed: int, model: Reflection) -> None:
    trial = try_standing(SETTINGS, seed, model, 20.0)
    assert trial.known
    assert [one for one, _ in trial.lost if one.model in {"wall", "drum"}] == []


@pytest.mark.parametrize(
    ("seed", "model"),
    [
        *(pytest.param(*both, marks=pytest.mark.soak) for both in itertools.product([2004, 2008], MODELS)),
    ],
)
def test_further_readings_of_an_unchanged_room_change_nothing(model: Reflection, seed: int) -> None:
    """Without noise they repeat what the robot heard when it stopped, so that the map stays as it is, to the bit."""
    ring = ring_of_room(seed)
    perception = Perception(ring, SETTINGS.models, SETTINGS.perception)
    before, compared = None, 0
    for firing in Wandering(ring, seed, 30.0, 20.0, acoustics=AcousticsConfig(model=model)).firings():
        perception.observe(firing)
        while perception.can_refine and perception.refine():
            pass
        if firing.robot_s > 30.0 + SETTLED_S:
            now = perception.labelled_objects()
            assert now == (now if before is None else before), firing.robot_s
            before, compared = now, compared + 1
    assert before
    assert compared > 100


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
