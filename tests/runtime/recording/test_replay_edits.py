"""Edits and drive requests are recorded as inputs and replayed to the bit from any start."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import orjson
import pytest

from behaviors.move_to_goal import Goal
from behaviors.teleoperation import Teleoperate
from config.errors import DONE
from config.load import load_model
from drivers.messages import Twist
from perception.edits import (
    ClearMap,
    ConfirmObject,
    DeleteSegments,
    MoveObject,
    PinSegments,
    PlaceModel,
    RejectObject,
)
from runtime.cli.app import run_command
from runtime.cycle.drive_requests import Legs
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.step import CycleRecord, Edit, State
from runtime.recording.channels import CYCLE, RawMessage, decode
from runtime.recording.reader import open_recording
from runtime.recording.schema import Cycle
from runtime.recording.verification import verify_recording
from runtime.simulation.closed_loop import OperatorInput
from tests.recorded import entries_of, hall, record, rewrite

SECONDS = 26.0
CYCLES = round(20 * SECONDS)


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
            yield PlaceModel("semicircle", 0.4, 0.1, 0.5)
            yield PlaceModel("box", -0.4, 0.2, 0.5)
        elif cycle in {240, 320} and objects:
            first = objects[0]
            yield MoveObject(first.number or 0, first.x + 0.05, first.y - 0.05, first.theta + 0.1)
            yield ConfirmObject(objects[-1].number or 0)
        elif cycle == 330 and len(objects) > 1:
            yield RejectObject(objects[1].number or 0)
            yield PinSegments(tuple(numbers[:2]), pinned=False)
            yield RejectObject(999_999)
        elif cycle == 500:
            yield ClearMap()


@pytest.fixture(scope="module", params=["bayes", "paper"])
def edited(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("edited") / "hall.mcap"
    box = load_model("box")
    before = hall(f"perception.method={request.param}")
    before = before.model_copy(update={"models": (*before.models, box)})
    # From cycle 350 on there is one model more.
    more = before.model_copy(update={"models": (*before.models, box.model_copy(update={"name": "crate"}))})
    person = Operator()
    status = record(before, path, SECONDS, operator=person, reloads={350: more})
    assert status.dropped == 0
    kinds = "delete_segments pin_segments place_model move_object reject_object confirm_object clear_map"
    assert set(person.done) == set(kinds.split()), "every kind of edit was tried"
    return path


def records_of(entries: list[RawMessage]) -> list[CycleRecord]:
    return [decode(Cycle, entry.data).record for entry in entries if entry.topic == CYCLE]


@pytest.mark.compiled
@pytest.mark.parametrize("since_s", [9.0, 17.0])
def test_replayed_to_the_bit_with_edits_and_drive_requests(edited: Path, since_s: float) -> None:
    with open_recording(edited) as recording:
        result = verify_recording(recording, since_s=since_s)
    assert result.first_difference is None, str(result.first_difference)
    assert result.differences == 0
    assert result.cycles >= 20 * (SECONDS - since_s)
    assert result.keyframes >= (SECONDS - since_s) / 2.0 - 2
    assert result.missing == []


@pytest.mark.compiled
def test_the_record_holds_what_was_done_and_what_was_refused(edited: Path) -> None:
    records = records_of(entries_of(edited))
    assert len(records) == CYCLES
    asked = [(r, i, edit) for r in records for i, edit in enumerate(r.inputs.edits)]
    refused = {(r.cycle, note.edit): note.why for r in records for note in r.refused}
    done = {type(edit) for r, i, edit in asked if (r.cycle, i) not in refused}
    assert done == {
        DeleteSegments, PinSegments, PlaceModel, MoveObject, RejectObject, ConfirmObject, ClearMap,
    }  # fmt: skip
    assert "no object 999999" in refused[330, 2]
    assert "invalid goal" in refused[460, None]
    assert all(why.isprintable() for why in refused.values())
    by_cycle = {r.cycle: r for r in records}
    assert by_cycle[200].inputs.drive_request == Goal(0.9, 0.2)
    assert isinstance(by_cycle[250].inputs.drive_request, Teleoperate)
    assert by_cycle[251].inputs.drive_request is None
    assert by_cycle[500].segments == 0
    assert by_cycle[499].segments > 0
    driven = [r.command for r in records if isinstance(r.command, Twist) and r.mode.mode is Mode.DRIVE]
    assert any(command.v > 0.0 for command in driven)
    modes = [by_cycle[c].mode.mode for c in (100, 372, 440, 452)]
    assert modes == [Mode.DRIVE, Mode.READY, Mode.DRIVE, Mode.SAFE_STOP]


@pytest.mark.compiled
def test_the_whole_run_is_verified(edited: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    summary = tmp_path / "s.json"
    assert run_command(["replay", str(edited), "--verify", "--json", str(summary)]) == DONE
    assert f"{CYCLES} cycles from cycle 1 on, 0 differences" in capsys.readouterr().out
    assert json.loads(summary.read_text())["verify"]["differences"] == 0


@pytest.mark.compiled
def test_a_replay_without_one_edit_differs(edited: Path, tmp_path: Path) -> None:
    entries = entries_of(edited)
    for i, entry in enumerate(entries):
        if entry.topic == CYCLE and decode(Cycle, entry.data).record.cycle == 150:
            found = orjson.loads(entry.data)
            found["record"]["inputs"]["edits"] = found["record"]["inputs"]["edits"][:1]
            entries[i] = entry._replace(data=orjson.dumps(found))
    rewrite(entries, tmp_path / "x.mcap")
    with open_recording(tmp_path / "x.mcap") as recording:
        result = verify_recording(recording)
    assert result.first_difference is not None
    assert result.first_difference.cycle >= 150
