"""Figures of trials."""

from __future__ import annotations

import math

import pytest

from bench.trials.localization_trials import RIGHT_M, RIGHT_RAD, Trial, figures, localize_once
from config.load import load_settings
from drivers.messages import Pose
from perception.localization.drumheller.localize import PoseCandidate

TRUTH = Pose(1.0, 2.0, math.pi - 0.01)
RIGHT = Pose(1.0, 2.0 + 0.5 * RIGHT_M, -math.pi + 0.01)
TURNED = Pose(1.0, 2.0, TRUTH.theta + 1.1 * RIGHT_RAD)
AWAY = Pose(1.0 + 1.1 * RIGHT_M, 2.0, TRUTH.theta)


def trial(*candidates: tuple[Pose, float]) -> Trial:
    """A trial with these candidates."""
    return Trial(TRUTH, tuple(PoseCandidate(*one) for one in candidates))


def test_a_trial_takes_the_map_of_the_room_or_of_another() -> None:
    ring = load_settings("hallway").ring
    assert localize_once(ring, 1).first_is_right
    assert not localize_once(ring, 1, map_seed=2).candidates


def test_figures_count_each_kind_of_answer() -> None:
    found = figures(
        [
            trial((RIGHT, 0.7), (AWAY, 0.3)),
            trial((AWAY, 0.7), (RIGHT, 0.3)),
            trial((TURNED, 0.95)),
            trial((AWAY, 0.5), (TURNED, 0.4)),
            trial(),
        ]
    )
    assert (found.trials, found.right, found.offered, found.wrong_alone) == (5, 1, 2, 2)
    assert (found.confidently_wrong, found.lost) == (1, 1)
    assert found.median_m == found.max_m == pytest.approx(0.5 * RIGHT_M)
    assert found.median_deg == pytest.approx(math.degrees(0.02))
