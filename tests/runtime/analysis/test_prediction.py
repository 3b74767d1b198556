"""Predicted readings: the score of a map against one computed by hand, and that it prefers the true map."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from config.errors import UserError
from config.load import load_settings
from config.settings import Settings
from drivers.messages import Firing, Pose
from runtime.analysis.prediction import predicted_nat, withhold

SETTINGS = load_settings("hallway", ["ring.resolution_m=0.0"], models=["drum"])
RADIUS = SETTINGS.models[0].arc_radius_m or 0.0


def perceived(*drums: tuple[float, float]) -> Any:
    row = {"model": "drum", "theta": 0.0, "sigma": 0.01, "support": 9, "score": 1.0}
    return {"objects": [{**row, "x": x, "y": y} for x, y in drums], "walls": []}


def looks(count: int, range_m: float = math.nan) -> list[Firing]:
    """Return firings of the sensor that looks ahead, on the way to a drum at (3, 0)."""
    mount = SETTINGS.ring.mounts[0]
    firings = []
    for i in range(count):
        ranges = np.full(len(SETTINGS.ring.mounts), np.nan)
        ranges[0] = 3.0 - RADIUS - mount.x_m - 0.01 * i if math.isnan(range_m) else range_m
        firings.append(Firing(0.1 * i, Pose(0.01 * i, 0.0, 0.0), 0.0, ranges))
    return firings


def test_exact_echoes_score_what_the_likelihood_says() -> None:
    firings = looks(5)
    window = float(firings[0].ranges_m[0])
    sigma = np.array([math.hypot(0.01, 0.01 * one.ranges_m[0]) for one in firings])
    peak = (1.0 - 0.05 - 0.05) / (sigma * math.sqrt(2.0 * math.pi))
    by_hand = float(np.log((peak + 0.05 / window) / (0.5 / window)).mean())
    assert predicted_nat(SETTINGS, perceived((3.0, 0.0)), firings) == pytest.approx(by_hand)


def test_the_true_map_is_better_than_none_and_a_wrong_one_worse() -> None:
    firings = looks(20)
    true, none, near, false = (
        predicted_nat(SETTINGS, perceived(*drums), firings)
        for drums in ([(3.0, 0.0)], [], [(3.2, 0.0)], [(3.0, 0.0), (1.5, 0.0)])
    )
    assert true > max(none, near, false) + 1.0
    assert predicted_nat(SETTINGS, perceived(), looks(20, math.inf)) > none, "silence is what an empty map predicts"


def test_the_scale_of_the_score_is_not_that_of_a_setting() -> None:
    firings, longer = looks(5), load_settings("hallway", ["ring.range_max_m=20.0", "ring.resolution_m=0.0"])
    settings: list[Settings] = [SETTINGS, longer.model_copy(update={"models": SETTINGS.models})]
    first, second = (predicted_nat(one, perceived((3.0, 0.0)), firings) for one in settings)
    assert first == second


def test_the_same_firings_are_withheld_every_time() -> None:
    firings = looks(500)
    given, withheld = withhold(firings)
    assert len(given) + len(withheld) == 500
    assert 70 < len(withheld) < 130
    assert {one.robot_s for one in given}.isdisjoint(one.robot_s for one in withheld)
    assert withhold(iter(firings)) == (given, withheld)


def test_nothing_to_predict_is_said() -> None:
    with pytest.raises(UserError, match="too few firings"):
        predicted_nat(SETTINGS, perceived(), [])
