"""Tests of what stands in for a method: an empty map that refuses every edit."""

from __future__ import annotations

from config.load import load_settings
from perception.edits import ClearMap
from perception.no_method import NOT_READY, NOTHING, NoMethod
from perception.pipeline import Perception

SETTINGS = load_settings("hallway")


def test_the_empty_map_refuses_edits_and_changes_with_nothing() -> None:
    perception = Perception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception, recognises=False)
    before = perception.segments()
    assert isinstance(perception.method, NoMethod)
    assert perception.edit(ClearMap()) == NOT_READY
    perception.apply_settings(SETTINGS.perception)
    perception.set_models(())
    perception.reset()
    perception.method.drop_caches()
    perception.method.follow_maps(1, None)
    assert perception.segment_geometry().shape == (0, 5)
    assert len(before.numbers) == len(before.times) == len(before.pinned) == 0
    assert (perception.counts, perception.objects(), perception.evidence(1)) == (NOTHING, (), None)
    assert (perception.can_refine, perception.refine(), perception.converged) == (False, 0, True)
