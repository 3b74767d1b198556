"""Recording is switched on and off during a run, and bookmarked: each file is whole and replays to the bit."""

from __future__ import annotations

import errno
import json
import os
import re
from collections.abc import Callable
from pathlib import Path

import orjson
import pytest
import structlog

from config.errors import DONE
from config.load import load_settings
from drivers.emulator.robot_device import GroundTruth
from drivers.messages import Pose
from runtime.cli.app import run_command
from runtime.cli.commands.run.run_recording import RunRecording, open_run_recording
from runtime.cycle.step import CycleRecord, State
from runtime.recording.channels import BOOKMARK, CYCLE, KEYFRAME, RUN_INFO, SERIAL, decode
from runtime.recording.reader import open_recording
from runtime.recording.recorder import BOOKMARK_MAX, Recorder, run_info
from runtime.recording.schema import Bookmark, SerialBytes
from runtime.recording.storage import RotatingFolder, SingleFile
from runtime.recording.writer import RecorderStatus, RecordingWriter
from runtime.simulation.closed_loop import simulate
from tests.recorded import entries_of, hall, record, until, verify_file


def switched(path: Path, after: dict[int, Callable[[Recorder], None]], seconds: float, *, on: bool) -> RecorderStatus:
    """Record a run by the paper's method; `after` holds the actions after some cycles."""
    return record(hall("perception.method=paper"), path, seconds, after=after, on=on)


def cycles_of(path: Path) -> list[int]:
    found = []
    for entry in entries_of(path):
        if entry.topic == CYCLE:
            number = re.match(rb'\{"record":\{"cycle":(\d+),', entry.data)
            assert number is not None, "the replay counts by it"
            found.append(int(number[1]))
    return found


def opened(recorder: Recorder) -> None:
    until(lambda: recorder.status.is_writing, "a file")


def closed(recorder: Recorder) -> None:
    until(lambda: not recorder.status.is_writing, "the end of the file")


def test_off_and_on_again(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"

    def off(recorder: Recorder) -> None:
        recorder.set_enabled(on=False)
        assert not recorder.is_enabled
        closed(recorder)

    status = switched(
        path,
        {1: opened, 60: off, 100: lambda r: r.set_enabled(on=True), 101: opened,
         102: lambda r: r.set_enabled(on=True)},
        8.0, on=True,
    )  # fmt: skip
    assert (status.files, status.dropped, status.last_error) == (2, 0, None)
    assert cycles_of(path) == list(range(1, 61))
    second = tmp_path / "run-2.mcap"
    assert cycles_of(second) == list(range(102, 161))
    assert next(e.topic for e in entries_of(second) if e.topic != RUN_INFO) == KEYFRAME, "the file begins with it"
    for file, count, first in ((path, 60, 1), (second, 59, 102)):
        result = verify_file(file)
        assert (result.cycles, result.first_cycle, result.differences) == (count, first, 0)
        assert (result.missing, result.skipped) == ([], 0)
        with open_recording(file) as recording:
            list(recording.messages())
            assert recording.finished


def test_bytes_that_a_failed_file_loses_are_counted_and_not_in_the_next_one(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"run\xff.mcap")
    writer = RecordingWriter(SingleFile(path), run_info(hall(), lambda: 0.0, emulated=False))
    writer._begin()
    for piece in (b"a", b"b"):
        writer._enter((SERIAL["in"], 1.0, 1.0, piece))
    writer._abandon(f"{path}: No space left on device")
    writer._open()
    writer._enter((SERIAL["in"], 12.0, 12.0, b"c"))
    writer._finish()
    assert (writer.status.files, writer.status.dropped) == (2, 2)
    assert orjson.dumps(writer.status).startswith(b'{"file":"')
    found = [
        decode(SerialBytes, e.data).pieces()
        for e in entries_of(path.with_stem(f"{path.stem}-2"))
        if e.topic == SERIAL["in"]
    ]
    assert found == [[(12.0, b"c")]]


def test_a_disk_that_is_full_before_the_first_byte_is_named_by_its_place(tmp_path: Path) -> None:
    """It was "None: No space left on device"."""

    def fail() -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    for target in (
        SingleFile(tmp_path / "run.mcap"),
        RotatingFolder(tmp_path, "run", load_settings("hallway").recording),
    ):
        writer = RecordingWriter(target, run_info(hall(), lambda: 0.0, emulated=False))
        writer._guarded(fail)
        assert writer.status.last_error == f"{target.place}: No space left on device"


def test_off_from_the_beginning_leaves_nothing(tmp_path: Path) -> None:
    status = switched(tmp_path / "run.mcap", {}, 2.0, on=False)
    assert (status.files, status.dropped, status.last_error) == (0, 0, None)
    assert list(tmp_path.iterdir()) == []


def test_on_in_mid_run(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    switched(path, {30: lambda r: r.set_enabled(on=True), 31: opened}, 4.0, on=False)
    assert cycles_of(path) == list(range(32, 81))
    assert verify_file(path).differences == 0


def test_bookmarks_are_in_it_and_without_side_effects(tmp_path: Path) -> None:
    path, refused = tmp_path / "run.mcap", list[str | None]()

    def mark(recorder: Recorder) -> None:
        assert recorder.bookmark("  here\n it <b>was</b>  ") is None
        refused.extend(recorder.bookmark(text) for text in ("", " \n ", "x" * (BOOKMARK_MAX + 1)))

    def too_late(recorder: Recorder) -> None:
        recorder.set_enabled(on=False)
        refused.append(recorder.bookmark("too late"))

    switched(path, {1: opened, 40: mark, 70: too_late}, 4.0, on=True)
    assert [why is not None and ("from 1 to" in why) for why in refused[:-1]] == [True] * 3
    assert "nothing is being recorded" in str(refused[-1])
    marks = [decode(Bookmark, entry.data) for entry in entries_of(path) if entry.topic == BOOKMARK]
    assert marks == [Bookmark(run_s=marks[0].run_s, cycle=40, text="here it <b>was</b>")]
    assert marks[0].run_s == pytest.approx(2.0)
    assert verify_file(path).differences == 0
    recovered = tmp_path / "recovered.mcap"
    assert run_command(["recover", str(path), "--out", str(recovered)]) == DONE
    assert [entry.data for entry in entries_of(recovered) if entry.topic == BOOKMARK] == [
        entry.data for entry in entries_of(path) if entry.topic == BOOKMARK
    ]


async def in_folder_of(
    folder: Path, act: Callable[[RunRecording], object], *, no_record: bool, record: str | None
) -> RunRecording:
    """Record a short run as the command `run` does."""
    settings = load_settings("hallway", ["perception.method=paper", f"recording.folder={json.dumps(str(folder))}"])
    assert settings.world is not None
    with open_run_recording(settings, record, no_record=no_record, emulated=True) as recording:
        observers = recording.observers(None, structlog.get_logger())

        def on_cycle(record: CycleRecord, _truth: GroundTruth) -> None:
            pass

        def on_state(record: CycleRecord, state: State, _start: Pose) -> None:
            assert observers.on_cycle is not None
            observers.on_cycle(record, state, None, None)  # type: ignore[arg-type]
            for firing in record.inputs.received.firings:
                if observers.on_firing is not None:
                    observers.on_firing(firing)
            if record.cycle == 20:
                act(recording)
            if record.cycle == 21:
                until(lambda: recording.now is not None, "a file")

        simulate(settings, settings.world, 0, 2.0, on_cycle, on_state=on_state)
    return recording


@pytest.mark.parametrize("record", [None, "firings.csv"])
async def test_a_run_that_records_nothing_may_be_switched_on(tmp_path: Path, record: str | None) -> None:
    log = None if record is None else str(tmp_path / record)
    folder = tmp_path / "runs"

    def on(recording: RunRecording) -> None:
        assert recording.now is None
        assert (recording.summary_row is None) == (log is None), "a ring log is there from the first"
        recording._recorder.set_enabled(on=True)

    recording = await in_folder_of(folder, on, no_record=True, record=log)
    assert recording.summary_row is not None
    (path,) = folder.glob("*.mcap")
    assert recording.summary_row["file"] == (str(path) if log is None else log)
    assert cycles_of(path)[0] == 22
    recording.raise_if_incomplete()


async def test_requests_of_the_console_reach_the_recorder() -> None:
    class Recording:
        def __init__(self) -> None:
            self.asked: list[object] = []

        def set_enabled(self, *, on: bool) -> None:
            self.asked.append(on)

        def bookmark(self, text: str) -> str | None:
            self.asked.append(text)
            return "no"

    recorder = Recording()
    recording = RunRecording(recorder, None, is_requested=False)  # type: ignore[arg-type]
    assert await recording.record(on=True) is None
    assert await recording.bookmark("here") == "no"
    assert recorder.asked == [True, "here"]
