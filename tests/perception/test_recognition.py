"""Tests of the parts that begin with recognition: those that the settings name, and none without it."""

from __future__ import annotations

import pytest

from config.load import load_settings, with_known_room
from perception.pipeline import Perception
from perception.recognition import prepare_recognition

PAPER = "perception.method=paper"
DRIFT = "perception.localization.correct_drift=true"
GRID = "perception.grid.method=elfes"


@pytest.mark.covered
@pytest.mark.parametrize(("set_", "has_room"), [(PAPER, False), (PAPER, True), (DRIFT, False), (GRID, True)])
def test_recognition_that_begins_later_has_the_parts_of_one_from_the_start(set_: str, has_room: bool) -> None:
    settings = load_settings("hallway", [PAPER, set_])
    settings = with_known_room(settings, "hallway") if has_room else settings
    whole = Perception(settings.ring, settings.models, settings.perception)
    later = Perception(settings.ring, settings.models, settings.perception, recognises=False)
    assert (later.recognises, later.localized(), later.occupancy(), later.room) == (False, None, None, None)
    later.prepared = ready = prepare_recognition(settings.ring, settings.models, settings.perception)
    later.recognise(settings.models, settings.perception)
    assert later.recognises
    assert later.method is ready.parts.method, "what was made in another thread is used"
    ours, theirs = later.snapshot(), whole.snapshot()
    assert list(ours) == list(theirs), "the same arrays in the same order"
    assert all(ours[name].tobytes() == theirs[name].tobytes() for name in ours)
    later.recognise(settings.models, settings.perception, on=False)
    later.prepared = ready._replace(settings=(settings.ring, settings.models[:0], settings.perception))
    assert (later.recognises, later.localized(), later.occupancy(), later.room) == (False, None, None, None)
    later.recognise(settings.models, settings.perception)
    assert later.method is not ready.parts.method, "it was made for other models"
