"""Undo of map edits: each edit is taken back by ordinary edits, and the map is as before."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from perception.edits import (
    ClearMap,
    ConfirmObject,
    DeleteSegments,
    Edit,
    LiftArea,
    MarkVacant,
    MoveObject,
    PinSegments,
    PlaceModel,
    PlaceRobot,
    RejectObject,
)
from perception.paper.paper_method import PaperPerception
from perception.pipeline import Perception
from runtime.console.commands.edit_history import KEPT, EditHistory, prepare_undo
from tests.perception.edited import fresh, number_of
from tests.runtime.console.console_case import open_console

PLACED = 3
"""Number of the placed object: the segments' cluster took two before it."""
AREA = MarkVacant(4.0, 4.0, 0.5)


@pytest.fixture
def seen() -> Perception:
    """A map of twelve segments, two of them pinned, with a placed object and a vacant area."""
    perception = fresh("paper")
    assert isinstance(perception.method, PaperPerception)
    ends = np.array([[0.1 * k, 1.0, 0.1 * k + 0.1, 1.0, np.pi / 2] for k in range(12)])
    perception.method.outline.add(ends, 3.0)
    for edit in (PinSegments((2, 3), pinned=True), PlaceModel("drum", 1.0, 1.0, 0.2), AREA):
        assert perception.edit(edit) is None
    return perception


def state_of(perception: Perception) -> dict[str, Any]:
    """Return what an operator sees, without the numbers of areas, which are never given twice."""
    held = perception.segments()
    order = np.argsort(held.numbers)
    return {
        "segments": [column[order].tolist() for column in held],
        "objects": [(o.number, o.x, o.y, o.theta, o.confirmed, o.placed) for o in perception.labelled_objects()],
        "areas": [(a.x, a.y, a.radius) for a in perception.vacant_areas()],
    }


@pytest.mark.promise("P31")
@pytest.mark.parametrize(
    "edit",
    [DeleteSegments((1, 2, 5)), PinSegments((2, 7), pinned=True), PinSegments((2, 7), pinned=False),
     PlaceModel("drum", 4.1, 4.0, 0.0), MoveObject(PLACED, 2.0, 2.0, 1.0), ConfirmObject(PLACED),
     RejectObject(PLACED), MarkVacant(0.0, 0.0, 1.0), LiftArea(1)],
    ids=lambda edit: edit.kind,
)  # fmt: skip
def test_an_edit_is_taken_back(seen: Perception, edit: Edit) -> None:
    before = state_of(seen)
    undo = prepare_undo(edit, seen)
    assert seen.edit(edit) is None
    assert state_of(seen) != before
    for back in undo():
        assert seen.edit(back) is None
    assert state_of(seen) == before


def test_a_cleared_map_has_its_segments_again(seen: Perception) -> None:
    before = state_of(seen)
    undo = prepare_undo(ClearMap(), seen)
    assert seen.edit(ClearMap()) is None
    for back in undo():
        assert seen.edit(back) is None
    assert state_of(seen) == before | {"objects": []}
    assert seen.edit(undo()[0]) is None, "a segment that is in the map stays as it is"
    assert state_of(seen)["segments"] == before["segments"]


def test_what_changes_nothing_is_not_kept(seen: Perception) -> None:
    history = EditHistory()
    assert seen.edit(ConfirmObject(number_of(seen.objects()[0]))) is None
    for edit in (
        ConfirmObject(PLACED),
        PinSegments((2,), pinned=True),
        DeleteSegments((99,)),
        PlaceRobot(0.0, 0.0, 0.0),
    ):
        history.add(edit, prepare_undo(edit, seen)())
    assert history.take() is None
    for k in range(KEPT + 5):
        history.add(MoveObject(k, 0.0, 0.0, 0.0), (MoveObject(k, 1.0, 0.0, 0.0),))
    newest = history.take()
    assert newest is not None
    assert newest[0] == MoveObject(KEPT + 4, 0.0, 0.0, 0.0)
    assert sum(history.take() is not None for _ in range(KEPT)) == KEPT - 1


async def test_a_page_takes_the_newest_edit_back_once() -> None:
    async with open_console() as case:
        page = await case.page()
        assert "no edit of the map" in (await page.ask(type="undo_edit"))["error"]
        case.run.state.perception.edit(AREA)
        number = await page.send(type="lift_area", area=1)
        await case.settled(lambda: case.run.asked == [LiftArea(1)], "the edit")
        case.run.state.perception.edit(LiftArea(1))
        case.cycles(edits=(LiftArea(1),))
        assert (await page.answer(number))["ok"]
        number = await page.send(type="undo_edit")
        await case.settled(lambda: case.run.asked == [LiftArea(1), AREA], "what takes it back")
        case.cycles(edits=(AREA,))
        assert (await page.answer(number))["data"] == "lift_area"
        assert not (await page.ask(type="undo_edit"))["ok"], "an undo is no edit to undo"
