"""Frames of a recording, made by the program of `run`: like those of a live run, in order and without a gap."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import orjson
import pytest

from config.load import load_settings
from perception.edits import DeleteSegments
from runtime.cli.commands.run.serve_console import REPLAY_PROGRAM
from runtime.console.playback.replay_client import ReplayClient
from runtime.console.playback.replay_cursor import ReplayCursor
from runtime.console.playback.replay_frames import ReplayFrames
from runtime.console.playback.replay_worker import PlaybackPosition
from runtime.cycle.inputs import OperatorInput, Request
from runtime.cycle.modes import Mode
from runtime.cycle.step import State
from runtime.recording.reader import open_recording, parse_settings
from tests.hil.machine import TIMEOUT_S
from tests.recorded import hall, record
from tests.runtime.console.playback.test_replay_client import Page, until

SECONDS = 5.0


def operator(_cycle: int, state: State) -> OperatorInput:
    """Arm, and delete a segment every fifteen cycles."""
    numbers = state.perception.segments().numbers.tolist()
    edits = (DeleteSegments((numbers[0],)),) if state.cycle % 15 == 0 and numbers else ()
    return OperatorInput(Request.ARM if state.mode.mode is Mode.READY else None, edits=edits)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    record(hall(), folder / "hall.mcap", SECONDS, operator=operator)
    return folder


def test_the_changes_of_all_frames_add_up_to_the_last_map(folder: Path) -> None:
    seen: dict[int, Any] = {}
    with open_recording(folder / "hall.mcap") as recording:
        cursor = ReplayCursor(recording)
        frames = ReplayFrames(parse_settings(recording.info.settings), emulated=recording.info.emulated)
        for replayed in cursor.seek(cursor.cycles):
            frames.take(replayed.record)
            parts = frames.frame(replayed, PlaybackPosition(cursor.t_s, is_playing=True, speed=2.0))
            changes, whole = (orjson.loads(b"{%b}" % part)["segments"] for part in (parts.changes, parts.whole))
            if changes["whole"]:
                seen.clear()
            for number in changes["removed"]:
                del seen[number]
            seen |= {row[0]: row for row in changes["added"]}
            numbers = replayed.state.perception.segments().numbers.tolist()
            assert sorted(seen) == sorted(row[0] for row in whole["added"]) == sorted(numbers)
        head = orjson.loads(parts.head + b"}")
    assert len(seen) > 10
    assert (head["cycle"], head["mode"]) == (cursor.cycles, "DRIVE")
    assert head["playback"] == {"s": cursor.t_s, "is_playing": True, "speed": 2.0}
    assert (head["paused"], head["speed"]) == (False, 1.0), "time control is shown of the live run only"
    assert (head["link"], head["late"], head["missed"]) == (None, None, None), "a recording does not hold them"
    assert len(head["objects"]) == len(replayed.state.perception.labelled_objects())


@pytest.mark.realtime
@pytest.mark.usefixtures("warm_kernels")
async def test_a_client_is_shown_a_recording(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("runtime.console.playback.replay_client.OPEN_MAX_S", TIMEOUT_S)
    page, client = Page(), ReplayClient(folder, REPLAY_PROGRAM, lambda: None)
    try:
        about = (await client.open(page, "hall.mcap"))["about"]
        assert (len(about["ring"]["mounts"]), about["emulated"], "units" in about) == (24, True, False)
        assert about["truth"] is not None
        assert about["truth"]["drums"]
        await client.seek(page, 4.0)
        await until(lambda: bool(page.frames) and page.last["playback"]["s"] == pytest.approx(4.0))
        assert page.last["segments"]["whole"]
        assert len(page.last["segments"]["added"]) > 10
        assert page.last["controller"] is True
    finally:
        await client.close()


def test_frames_of_a_recording_have_its_cross_paths(tmp_path: Path) -> None:
    record(load_settings("hallway", ["perception.method=paper"], robot="ears"), tmp_path / "ears.mcap", 1.0)
    with open_recording(tmp_path / "ears.mcap") as recording:
        cursor = ReplayCursor(recording)
        frames = ReplayFrames(parse_settings(recording.info.settings), emulated=recording.info.emulated)
        for at in (cursor.cycles, cursor.cycles // 2):
            heard: list[float] = []
            for replayed in cursor.seek(at):
                frames.take(replayed.record)
                heard += [
                    firing.robot_s
                    for firing in replayed.record.inputs.received.firings
                    if firing.cross_paths is not None and np.isfinite(firing.cross_paths.half_paths_m).any()
                ]
            parts = frames.frame(replayed, PlaybackPosition(cursor.t_s, is_playing=False, speed=1.0))
            shown = orjson.loads(parts.head + b"}")["cross_paths"]
            assert shown[-1]["robot_s"] == pytest.approx(heard[-1], abs=1e-3), "the newest of this position"
            assert all(row["paths"] for row in shown)
