"""Edits and drive requests are recorded as inputs and replayed to the bit from any start."""

from __future__ import annotations

import json
from pathlib import Path

import orjson
import pytest

from behaviors.move_to_goal import Goal
from behaviors.teleoperation import Teleoperate
from config.errors import DONE
from drivers.messages import Twist
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
    RestoreArea,
    RestoreObjects,
    RestoreSegments,
    WithdrawConfirmation,
    WithdrawPlacement,
)
from runtime.cli.app import run_command
from runtime.cycle.modes import Mode
from runtime.cycle.step import CycleRecord
from runtime.recording.channels import CYCLE, RawMessage, decode
from runtime.recording.reader import open_recording
from runtime.recording.schema import Cycle
from runtime.recording.verification import verify_recording
from tests.recorded import entries_of, rewrite
from tests.runtime.recording.edited_run import SECONDS

CYCLES = round(20 * SECONDS)


def records_of(entries: list[RawMessage]) -> list[CycleRecord]:
    return [decode(Cycle, entry.data).record for entry in entries if entry.topic == CYCLE]


@pytest.mark.compiled
@pytest.mark.parametrize("since_s", [pytest.param(9.0, marks=pytest.mark.soak), 17.0])
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
        DeleteSegments, PinSegments, RestoreSegments, PlaceModel, MoveObject, RemoveObject, RejectObject, MarkVacant,
        LiftArea, RestoreArea, ConfirmObject, WithdrawConfirmation, WithdrawPlacement, RestoreObjects, ClearMap,
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
