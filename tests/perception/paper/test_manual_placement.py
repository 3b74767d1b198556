"""Placements and rejections of an operator: rows, order, relaxation, and which segments count after a rejection."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_model
from config.settings import RelaxationConfig
from perception.object_model import ObjectModel
from perception.paper.manual_placement import NumberSource, Placements, Rejections, wrapped_pose
from perception.paper.paper_method import PaperPerception
from perception.paper.parameters import PLACEMENTS_MAX
from tests.perception.halls import settings

MODELS = tuple(ObjectModel.from_config(load_model(name)) for name in ("semicircle", "box"))


def placements() -> Placements:
    return Placements(MODELS, RelaxationConfig(), 0.5)


def test_numbers_are_given_once() -> None:
    numbers = NumberSource()
    assert [numbers.next() for _ in range(3)] == [1, 2, 3]
    assert numbers.last == 3


def test_a_placement_is_found_moved_and_removed_by_its_number() -> None:
    placed = placements()
    before = placed.pending
    for number in (5, 7, 9):
        placed.put(number, number % 2, (0.1 * number, 0.0, 0.0), confirmed=False)
    placed.put(7, 0, (1.0, 2.0, 3.0), confirmed=True)
    assert placed.count == 3
    assert (before, placed.pending) == (False, True)
    assert placed.find(7) == 1
    assert placed.rows[1]["pose"].tolist() == [1.0, 2.0, 3.0]
    assert (placed.rows[1]["model"], placed.rows[1]["is_confirmed"]) == (0, 1)
    placed.remove(0)
    assert (placed.find(5), placed.find(7), placed.find(9)) == (None, 0, 1)
    assert placed.rows[2]["number"] == 0
    placed.clear()
    assert (placed.count, placed.pending) == (0, False)


def test_placements_take_turns_and_rest_without_segments() -> None:
    chosen = settings()
    outline = PaperPerception(chosen.ring, chosen.models, chosen.perception).outline
    placed = placements()
    for number in (1, 2):
        placed.put(number, 0, (float(number), 0.0, 0.0), confirmed=False)
    assert placed.refine(outline) == 1, "nothing attracts it, so it rests at once"
    assert placed.rows["iterations_left"][:2].tolist() == [0, RelaxationConfig().iterations_max]
    placed.refine(outline)
    assert not placed.pending
    placed.restart_changed(outline)
    assert not placed.pending, "no segment has come or gone"
    outline.add(np.array([[1.3, -0.1, 1.3, 0.1, math.pi]]), 0.0)
    placed.restart_changed(outline)
    assert placed.rows["iterations_left"][:2].astype(bool).tolist() == [True, False], "a segment is near the first"
    assert len(placed.members(0, outline)) == 1
    placed.restart_all()
    assert placed.rows["iterations_left"][:2].all()


def test_a_rejection_excludes_older_segments_of_the_same_model_nearby() -> None:
    rejections = Rejections()
    rejections.add(1.0, 1.0, 0.5, model=0, newest_segment=40)
    rejections.add(1.1, 1.0, 0.5, model=0, newest_segment=60)
    assert rejections.newest_excluded(1.0, 1.0, 0) == 60
    assert rejections.newest_excluded(0.55, 1.0, 0) == 40
    assert rejections.newest_excluded(1.0, 1.0, 1) == 0, "another model"
    assert rejections.newest_excluded(3.0, 1.0, 0) == 0, "another place"
    for _ in range(PLACEMENTS_MAX):
        rejections.add(9.0, 9.0, 0.5, model=1, newest_segment=70)
    assert rejections.newest_excluded(1.0, 1.0, 0) == 0, "the oldest are overwritten"
    rejections.clear()
    assert rejections.newest_excluded(9.0, 9.0, 1) == 0


def test_a_pose_is_wrapped_in_its_heading_only() -> None:
    assert wrapped_pose(np.array([9.0, -9.0, 7.0])) == pytest.approx((9.0, -9.0, 7.0 - 2.0 * math.pi))
