"""What an operator places stays there until echoes support it, wherever the robot drives; it never wanders."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import get_args

import numpy as np
import pytest

from bench.standing import acoustics_of, ring_of_room
from bench.trials.furnished_rooms import furnished_room
from config.load import load_model, load_settings
from perception.bayes.memory.parameters import PLACED_STRAY_MAX_M
from perception.detected_object import DetectedObject
from perception.edits import PlaceModel
from perception.localization.room.expected_ranges import Reflection
from perception.pipeline import Perception
from tests.perception.wandering import Wandering

SETTINGS = load_settings("room", ["perception.method=bayes"])
MODELS = (*SETTINGS.models, load_model("box"))
PLACE_S, LOOK_S = 40.0, 5.0
SLACK_M = 1e-6
pytestmark = [pytest.mark.compiled]


def place(perception: Perception, model: str, x: float, y: float) -> DetectedObject:
    """Place a model and return the object."""
    known = {one.number for one in perception.labelled_objects()}
    assert perception.edit(PlaceModel(model, x, y, 0.3)) is None
    (placed,) = (one for one in perception.labelled_objects() if one.placed and one.number not in known)
    return placed


def strayed(seed: int, model: Reflection, minutes: float) -> list[str]:
    """Place drums and boxes anywhere after a short drive, drive on, and return which of them wandered, as text."""
    acoustics, ring = acoustics_of(model, seed), ring_of_room(seed)
    room, rng = furnished_room(seed, acoustics), np.random.default_rng([seed, 8])
    perception = Perception(ring, MODELS, SETTINGS.perception)
    placed, found, due_s = dict[int, DetectedObject](), list[str](), PLACE_S
    for firing in Wandering(ring, seed, PLACE_S + 60.0 * minutes, acoustics=acoustics).firings():
        perception.observe(firing)
        while perception.can_refine and perception.refine():
            pass
        if firing.robot_s < due_s:
            continue
        due_s += LOOK_S
        if not placed:
            (x, y), wall = room.place(*rng.uniform(-0.4, 0.4, 2).tolist()), room.world.wall[0]
            places = [(x, y), room.place(*rng.uniform(-0.4, 0.4, 2).tolist()), (wall.x1_m, wall.y1_m)]
            places += [(drum.x_m + 0.1, drum.y_m - 0.1) for drum in room.world.drum[:1]]
            for name, at in zip(("drum", "box", "drum", "drum"), places, strict=False):
                one = place(perception, name, *at)
                assert one.number is not None
                assert math.dist(at, (one.x, one.y)) <= PLACED_STRAY_MAX_M + SLACK_M
                placed[one.number] = one
        now = {one.number: one for one in (*perception.labelled_objects(), *perception.archived_objects())}
        for number, one in placed.items():
            seen = now.get(number)
            if seen is not None and math.dist((seen.x, seen.y), (one.x, one.y)) > PLACED_STRAY_MAX_M + SLACK_M:
                found.append(f"{model} {seed}: {one.model} {number} at {firing.robot_s:.0f} s")
            if seen is not None and seen.placed and (seen.x, seen.y, seen.theta) != (one.x, one.y, one.theta):
                found.append(f"{model} {seed}: {one.model} {number} moves without support")
    return found


@pytest.mark.parametrize(("seed", "model"), [pytest.param(0, "specular", marks=pytest.mark.soak), (3, "cone")])
def test_a_placed_object_never_wanders(seed: int, model: Reflection) -> None:
    assert strayed(seed, model, 0.5) == []


@pytest.mark.soak
@pytest.mark.parametrize("model", get_args(Reflection))
def test_no_placed_object_wanders_in_eighteen_minutes(model: Reflection, measured: Callable[[str], None]) -> None:
    found = [text for seed in range(300, 320) for text in strayed(seed, model, 18.0)]
    measured(f"{model}: {len(found)} times a placed object was elsewhere in 20 rooms, 18 min")
    assert found == []
