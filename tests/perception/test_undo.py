"""Undo is exact: after any sequence of edits and undos, each undo leaves the map as it was before its edit."""

from __future__ import annotations

import random
from collections.abc import Iterable
from dataclasses import astuple, fields
from typing import Any

import numpy as np
import pytest

from perception.detected_object import DetectedObject
from perception.edits import (
    ClearMap,
    ConfirmObject,
    DeleteSegments,
    Edit,
    LiftArea,
    MarkVacant,
    MoveObject,
    ObjectRow,
    PinSegments,
    PlaceModel,
    RejectObject,
    RestoreArea,
    RestoreObjects,
)
from perception.pipeline import Perception
from perception.undo import Undo, edit_with_undo
from tests.perception.edited import is_bayes, number_of

EDITS = 25
NUMBER = [field.name for field in fields(DetectedObject)].index("number")
GONE = 999_999
"""The number of no segment and no object."""


def rounded(values: Iterable[object]) -> list[object]:
    return [round(value, 9) if isinstance(value, float) else value for value in values]


def state_of(seen: Perception) -> dict[str, Any]:
    """Return what an operator sees, by number; lengths and angles to a nanometre, as they are turned to and fro."""
    held = seen.segments()
    order = np.argsort(held.numbers)
    known = [one for one in seen.known_objects() if one.number]
    shown = {one.number for one in (*seen.labelled_objects(), *seen.archived_objects())}
    return {
        "shown": shown - {None},
        "segments": [np.round(column[order], 9).tolist() for column in held],
        "objects": [rounded(astuple(one)) for one in sorted(known, key=lambda one: one.number or 0)],
        "areas": [rounded(area) for area in seen.vacant_areas()],
    }


def any_edit(rng: random.Random, seen: Perception) -> Edit:
    """Return a random edit; some name what does not exist, in whole or in part."""
    numbers = seen.segments().numbers.tolist()
    some = tuple(rng.sample(numbers, min(len(numbers), rng.randint(1, 12))))
    some = (*some, GONE) if rng.random() < 0.4 or not some else some
    one = rng.choice([*(number_of(one) for one in seen.known_objects() if one.number), GONE])
    x, y = rng.uniform(-1.0, 3.0), rng.uniform(-1.5, 1.5)
    areas = [area.number for area in seen.vacant_areas()]
    edits: list[Edit] = [
        DeleteSegments(some),
        PinSegments(some, pinned=rng.random() < 0.6),
        PlaceModel(rng.choice(["drum", "box", "no model"]), x, y, rng.uniform(-4.0, 4.0)),
        MoveObject(one, x, y, 0.3),
        ConfirmObject(one),
        RejectObject(one),
        MarkVacant(x, y, rng.uniform(0.1, 1.5)),
        LiftArea(rng.choice([*areas, GONE])),
    ]
    # The paper's method forgets a candidate that a placed model hides once the map is cleared.
    if is_bayes(seen) and rng.random() < 0.3:
        edits.append(ClearMap())
    return rng.choice(edits)


@pytest.mark.promise("P31")
@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(k, marks=pytest.mark.soak) for k in (2, 3))])
def test_each_undo_leaves_the_map_as_it_was_before_its_edit(seen: Perception, seed: int) -> None:
    rng = random.Random(seed)
    begin = state_of(seen)
    done: list[tuple[dict[str, Any], Edit, Undo]] = []

    def take_back() -> None:
        before, edit, undo = done.pop()
        for back in undo:
            assert seen.edit(back) is None, f"{back} of {edit}"
        assert state_of(seen) == before, edit

    made = 0
    for _ in range(EDITS):
        if done and rng.random() < 0.3:
            take_back()
            continue
        before, edit = state_of(seen), any_edit(rng, seen)
        refused, undo = edit_with_undo(edit, seen)
        if undo:
            done.append((before, edit, undo))
            made += 1
        else:
            assert state_of(seen) == before, f"{edit} ({refused}) changed what no undo takes back"
    assert made
    while done:
        take_back()
    assert state_of(seen) == begin


def test_a_cleared_map_has_its_segments_and_objects_again(seen: Perception) -> None:
    before = state_of(seen)
    kept = [one for one in before["objects"] if seen.method.kept(one[NUMBER]) is not None]
    refused, undo = edit_with_undo(ClearMap(), seen)
    assert refused is None
    assert state_of(seen)["objects"] == []
    for back in undo:
        assert seen.edit(back) is None
    after = state_of(seen)
    assert after["segments"] == before["segments"]
    assert len(kept) >= 4
    assert after["objects"] == kept


@pytest.mark.parametrize(
    "kept", ["", "circle:", "circle:AAAA", "polygon:!", "placement:99999999", "candidate:7", "x"]
)
def test_what_was_not_kept_by_this_method_is_refused(seen: Perception, kept: str) -> None:
    before = state_of(seen)
    assert "cannot be put back" in str(
        seen.edit(RestoreObjects((ObjectRow(1, 0.0, 0.0, 0.0, confirmed=False, kept=kept),)))
    )
    assert "invalid pose" in str(
        seen.edit(RestoreObjects((ObjectRow(1, np.nan, 0.0, 0.0, confirmed=False, kept=kept),)))
    )
    assert "was not lifted" in str(seen.edit(RestoreArea(1, 0.0, 0.0, 0.5, 0)))
    assert state_of(seen) == before


def test_what_is_rejected_cannot_be_confirmed(seen: Perception) -> None:
    number = number_of(seen.objects()[0])
    assert seen.edit(RejectObject(number)) is None
    for edit in (ConfirmObject(number), RejectObject(number)):
        assert "was rejected" in str(seen.edit(edit))
