"""Readings of a ring that may be anywhere: a distribution, and the share of sensors that hear something."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bench.trials.furnished_rooms import furnished_room
from perception.localization.known_room.background import Background
from perception.localization.known_room.mixed_reflection import LearnedShares
from perception.localization.known_room.surroundings import make_surroundings
from perception.localization.room.range_likelihood import RangeModel
from perception.localization.room.room import make_room, room_of
from tests.perception.localization.rooms import HALF_ANGLE

MODEL = RangeModel(0.03, 5.0)
STEP_M = MODEL.window_m / 254.0


def background_of(seed: int | None) -> Background:
    """The background of a furnished room, or of one wall that is out of reach of most places."""
    walls = np.array([[0.0, 0.0, 0.01, 0.0]])
    room = make_room(walls) if seed is None else room_of(furnished_room(seed).world)
    return Background(room, make_surroundings(room, MODEL, HALF_ANGLE), 0.2)


@pytest.mark.parametrize("seed", [1, None])
def test_ranges_have_a_density_and_silence_the_rest(seed: int | None) -> None:
    background, shares = background_of(seed), LearnedShares()
    background.heard_share = 0.7
    ranges_m = np.arange(0.5 * STEP_M, MODEL.window_m, STEP_M)
    even = 0.5 / MODEL.window_m
    density = [even * math.exp(background.log_ratio(np.array([r]), shares)) for r in ranges_m.tolist()]
    silence = 0.5 * math.exp(background.log_ratio(np.array([math.inf]), shares))
    assert sum(density) * STEP_M == pytest.approx(0.7, abs=0.01)
    assert silence == pytest.approx(0.3)
    some = np.array([1.0, math.inf, 2.0])
    alone = [background.log_ratio(np.array([r]), shares) for r in some.tolist()]
    assert background.log_ratio(some, shares) == pytest.approx(sum(alone))


@pytest.mark.covered
def test_the_share_that_hears_is_learned_and_forgotten() -> None:
    background = background_of(1)
    for _ in range(200):
        background.observe(np.array([1.0, math.inf, math.inf, math.inf]))
    assert background.heard_share == pytest.approx(0.25, abs=0.02)
    for _ in range(1000):
        background.observe(np.full(4, math.inf))
    assert background.heard_share == pytest.approx(0.1)
    background.reset()
    assert background.heard_share == 0.5
