"""P27: no drum is reported where none stands, in rooms of walls and boxes that nothing was tuned on."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from bench.trials.drumless_rooms import NOISE_RELATIVE, drumless_room
from bench.trials.false_drum_trials import FalseDrumTrial, try_room
from config.load import load_settings
from config.world import AcousticsConfig
from perception.detected_object import DetectedObject

pytestmark = pytest.mark.promise("P27")

SETTINGS = load_settings("hallway", ["perception.method=bayes"])
FALSE_SHARE_MAX = 1e-3


def test_a_look_is_false_if_it_holds_a_sure_model_and_objects_are_counted_once() -> None:
    trial, models = FalseDrumTrial(), frozenset({"drum"})
    drum = DetectedObject("drum", 1.0, 2.0, 0.0, 0.1, 9, 0.96, 0.96, number=4)
    wall = DetectedObject("wall", 1.0, 2.0, 0.0, 0.1, 9, 1.0, 1.0)
    unsure = DetectedObject("drum", 1.0, 2.0, 0.0, 0.1, 9, 0.9, 0.9, number=5)
    for k, seen in enumerate([(drum,), (drum, wall), (), (wall, unsure)]):
        trial.add(0.5 * k, seen, models)
    assert (trial.looks, trial.false_looks, trial.duration_s) == (4, 2, 1.5)
    (found,) = trial.drums.values()
    assert (found.looks, found.first_s, found.last_s) == (2, 0.0, 0.5)


@pytest.mark.compiled
def test_no_drum_in_a_room_of_walls_and_boxes(measured: Callable[[str], None]) -> None:
    trial = try_room(
        SETTINGS, drumless_room(110, AcousticsConfig(noise_relative=NOISE_RELATIVE), is_cluttered=False), 110, 90.0
    )
    measured(f"{trial.false_looks} of {trial.looks} looks in 90 s in a room where everything echoes")
    assert trial.false_looks <= FALSE_SHARE_MAX * trial.looks


@pytest.mark.soak
@pytest.mark.compiled
@pytest.mark.parametrize("model", ["cone", "specular"])
def test_no_drum_in_half_an_hour_in_each_of_ten_rooms(model: str, measured: Callable[[str], None]) -> None:
    acoustics = AcousticsConfig.model_validate({"model": model, "noise_relative": NOISE_RELATIVE})
    trials = [
        try_room(SETTINGS, drumless_room(seed, acoustics, is_cluttered=False), seed, 1800.0)
        for seed in range(100, 110)
    ]
    false, looks = sum(it.false_looks for it in trials), sum(it.looks for it in trials)
    measured(f"{model}: {false} of {looks} looks")
    assert false <= FALSE_SHARE_MAX * looks
