"""The library's way in: arrays give what the pipeline gives, and what a person may get wrong is refused."""

from __future__ import annotations

import numpy as np
import pytest

from config.load import load_world
from config.settings import PerceptionConfig
from perception.pipeline import Perception
from perception.recogniser import Recogniser
from tests.perception.halls import drive, settings

SETTINGS = settings()
FIRINGS = list(drive(load_world("hallway"), (-5.0, -3.5)))
POSES = np.array([(f.pose.x, f.pose.y, f.pose.theta) for f in FIRINGS])
RANGES = np.array([f.ranges_m for f in FIRINGS])
TIMES = np.array([f.robot_s for f in FIRINGS])
YAWS = np.array([f.ring_yaw for f in FIRINGS])


@pytest.mark.covered
@pytest.mark.parametrize("method", ["paper", "bayes"])
def test_arrays_give_what_the_pipeline_gives(method: str) -> None:
    config = PerceptionConfig(method=method)  # type: ignore[arg-type]
    recogniser = Recogniser(SETTINGS.ring, SETTINGS.models, config)
    perception = Perception(SETTINGS.ring, SETTINGS.models, config)
    for firing in FIRINGS:
        perception.observe(firing)
        while perception.can_refine:
            perception.refine()
    half = len(FIRINGS) // 2
    recogniser.add(POSES[:half], np.asfortranarray(RANGES[:half]), TIMES[:half], YAWS[:half])
    recogniser.add(POSES[half:].tolist(), RANGES[half:].tolist(), TIMES[half:].tolist())  # the ring looks ahead
    assert recogniser.perception.counts == perception.counts
    assert recogniser.perception.counts.segments_total > 0
    assert recogniser.objects() == perception.objects()
    assert recogniser.surroundings() == perception.labelled_objects()


@pytest.mark.covered
@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"poses": POSES[:, :2]}, r"poses of shape \(\d+, 2\): expected one row x, y, heading"),
        ({"ranges_m": RANGES[:, :8]}, r"for \d+ poses and 24 sensors: expected \(\d+, 24\)"),
        ({"ranges_m": -RANGES}, "negative ranges: expected metres"),
        ({"times_s": TIMES[1:]}, "times of shape"),
        ({"times_s": TIMES[::-1]}, "times that decrease: sort the firings"),
        ({"times_s": TIMES + np.nan}, "times that are not finite"),
        ({"ring_yaws": TIMES[1:]}, "ring yaws of shape"),
        ({"poses": POSES + np.inf}, "poses that are not finite"),
    ],
)
def test_what_does_not_fit_is_refused_whole(changed: dict[str, np.ndarray], message: str) -> None:
    recogniser = Recogniser(SETTINGS.ring, SETTINGS.models)
    given = {"poses": POSES, "ranges_m": RANGES, "times_s": TIMES, "ring_yaws": YAWS, **changed}
    with np.errstate(invalid="ignore"), pytest.raises(ValueError, match=message):
        recogniser.add(**given)
    assert recogniser.perception.counts.segments_total == 0


def test_a_later_call_may_not_go_back_in_time() -> None:
    recogniser = Recogniser(SETTINGS.ring, SETTINGS.models)
    recogniser.add(POSES[:2], RANGES[:2], TIMES[:2])
    with pytest.raises(ValueError, match="times that decrease"):
        recogniser.add(POSES[0], RANGES[0], TIMES[0])
