"""A recorded run in which an operator tries every kind of request and of edit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from behaviors.move_to_goal import Goal
from behaviors.teleoperation import Teleoperate
from config.load import load_model
from perception.edits import (
    ClearMap,
    ConfirmObject,
    DeleteSegments,
    LiftArea,
    MarkVacant,
    MoveObject,
    PinSegments,
    PlaceModel,
    RejectObject,
    RemoveObject,
    RestoreSegments,
    WithdrawConfirmation,
)
from runtime.cycle.drive_requests import Legs
from runtime.cycle.inputs import OperatorInput, Request
from runtime.cycle.step import Edit, State
from tests.recorded import hall, record

SECONDS = 26.0
RELOAD_CYCLE = 350
"""From this cycle on there is one model more."""


class Operator:
    """An operator who arms, gives every kind of drive request, and makes every kind of edit."""

    def __init__(self) -> None:
        self.done: list[str] = []

    def __call__(self, cycle: int, state: State) -> OperatorInput:
        request = Request.ARM if cycle in {5, 400} else {370: Request.DISARM, 450: Request.HALT}.get(cycle)
        drive_request: Any = {200: Goal(0.9, 0.2), 300: Legs(), 460: Goal(float("nan"), 0.0)}.get(cycle)
        if 250 <= cycle < 280 and cycle % 2 == 0:
            drive_request = Teleoperate(0.25, 0.1)
        edits = tuple(self.edits(cycle, state))
        self.done += [edit.kind for edit in edits]
        return OperatorInput(request, drive_request, edits)

    def edits(self, cycle: int, state: State) -> Iterator[Edit]:
        seen = state.perception
        numbers = sorted(seen.segments().numbers.tolist())
        objects = sorted((o for o in seen.objects() if o.number is not None), key=lambda o: o.number or 0)
        if cycle == 150:
            yield PinSegments(tuple(numbers[:6]), pinned=True)
            yield DeleteSegments(tuple(numbers[8:14]))
        elif cycle == 170:
            yield PlaceModel("drum", 0.4, 0.1, 0.5)
            yield PlaceModel("box", -0.4, 0.2, 0.5)
        elif cycle in {171, 241, 341}:
            yield from state.undos[-1]
        elif cycle in {240, 320} and objects:
            first = objects[0]
            yield MoveObject(first.number or 0, first.x + 0.05, first.y - 0.05, first.theta + 0.1)
            yield ConfirmObject(objects[-1].number or 0)
            yield MoveObject(first.number or 0, first.x - 0.05, first.y, first.theta)
        elif cycle == 330 and len(objects) > 1:
            yield RejectObject(objects[1].number or 0)
            yield PinSegments(tuple(numbers[:2]), pinned=False)
            yield RejectObject(999_999)
        elif cycle == 340 and seen.vacant_areas():
            yield MarkVacant(3.0, 0.0, 0.5)
            yield LiftArea(seen.vacant_areas()[0].number)
        elif cycle == 345:
            listed = zip(numbers[:4], seen.segments().geometry[:4].tolist(), strict=True)
            yield RestoreSegments(tuple((float(n), *ends, 1.0, 0.0) for n, ends in listed))
            yield WithdrawConfirmation(objects[-1].number or 0)
        elif cycle == 360:
            yield RemoveObject(objects[0].number or 0)
        elif cycle == 500:
            yield ClearMap()


def record_edited(path: Path, method: str) -> None:
    """Record the run by a method of perception."""
    box = load_model("box")
    before = hall(f"perception.method={method}")
    before = before.model_copy(update={"models": (*before.models, box)})
    more = before.model_copy(update={"models": (*before.models, box.model_copy(update={"name": "crate"}))})
    person = Operator()
    status = record(before, path, SECONDS, operator=person, reloads={RELOAD_CYCLE: more})
    assert status.dropped == 0
    kinds = (
        "delete_segments pin_segments restore_segments place_model move_object remove_object reject_object "
        "mark_vacant lift_area restore_area confirm_object withdraw_confirmation withdraw_placement restore_objects "
        "clear_map"
    )
    assert set(person.done) == set(kinds.split()), "every kind of edit was tried"
