"""False walls: how looks are counted, and short drives among drums, in which none is reported."""

from __future__ import annotations

import pytest

from bench.trials.false_wall_trials import STEPS_M, FalseWallTrial, drive_hall, drum_hall, try_hall
from config.load import load_settings
from perception.detected_object import DetectedObject
from runtime.simulation.random_halls import ACOUSTICS

SETTINGS = load_settings("hallway", ["perception.method=bayes"])


def test_a_look_is_false_if_it_holds_a_wall() -> None:
    trial = FalseWallTrial()
    drum = DetectedObject("semicircle", 1.0, 2.0, 0.0, 0.1, 9, 1.0, 1.0)
    likely, sure = (DetectedObject("wall", 1.0, 2.0, 0.0, 0.1, 9, p, p) for p in (0.6, 0.97))
    for seen in ((drum,), (drum, likely, sure), (likely,), ()):
        trial.add(seen)
    assert (trial.looks, trial.with_wall, trial.with_sure_wall, trial.at_end) == (4, 2, 1, 0)


def test_a_hall_of_drums_has_no_walls() -> None:
    world, path = drum_hall(3)
    assert len(world.drum) == 10
    assert len(world.wall) + len(world.box) + len(world.polygon) == 0
    assert path.shape[1] == 3


@pytest.mark.compiled
def test_no_wall_in_a_hall_of_drums() -> None:
    trial = try_hall(SETTINGS, 1000, ACOUSTICS, STEPS_M[-1])
    assert trial.looks > 5
    assert trial.with_wall == 0


@pytest.mark.compiled
def test_no_wall_in_the_shipped_hall() -> None:
    hours: list[float] = []
    assert SETTINGS.world is not None
    trial = drive_hall(SETTINGS, SETTINGS.world, 0, 15.0 / 3600.0, hours.append)
    assert len(hours) == trial.looks == 15
    assert trial.with_wall == 0
