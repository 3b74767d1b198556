"""Recordings are complete, fit their schemas, keep the folder's limits and do not block the loop."""

from __future__ import annotations

import json
import random
import statistics
import threading
import time
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from mcap.reader import NonSeekingReader, make_reader

from config.errors import UserError
from runtime.recording.channels import (
    BOOKMARK,
    BOOKMARK_WITHDRAWN,
    CHANNELS,
    CYCLE,
    KEYFRAME,
    LOG,
    MODE,
    RUN_INFO,
    SEGMENTS,
    SERIAL,
    SETTINGS,
    SUMMARY,
    decode,
    encode,
)
from runtime.recording.folder_index import create_listed
from runtime.recording.reader import open_recording
from runtime.recording.recorder import Recorder
from runtime.recording.schema import Cycle, LogLine, MapChange, Payload, SerialBytes
from runtime.recording.storage import MEGABYTE, RotatingFolder, SingleFile, has_bookmark, is_pinned, pin_of
from runtime.simulation.closed_loop import simulate
from tests.recorded import SECONDS, entries_of, hall, record, until, verify_file


def test_a_recording_holds_everything_that_happened(run: Path) -> None:
    entries = entries_of(run)
    by_topic = {topic: [e for e in entries if e.topic == topic] for topic in CHANNELS}
    absent = [topic for topic, found in by_topic.items() if not found]
    assert absent == [SETTINGS, BOOKMARK, BOOKMARK_WITHDRAWN], "none was requested"
    (end,) = by_topic[SUMMARY]
    assert json.loads(end.data)["summary"] == {"mode": "DRIVE", "cycles": 240.0}
    assert [decode(Cycle, e.data).record.cycle for e in by_topic[CYCLE]] == list(range(1, int(20 * SECONDS) + 1))
    for topic in SERIAL.values():
        pieces = [piece for e in by_topic[topic] for piece in decode(SerialBytes, e.data).pieces()]
        assert {data for _, data in pieces} == {b"\x00bytes\xff"}
        assert [t for t, _ in pieces] == pytest.approx([0.05 * k for k in range(int(20 * SECONDS))], abs=2e-6)
    modes = [json.loads(e.data)["mode"]["mode"] for e in by_topic[MODE]]
    assert modes[-1] == "DRIVE"
    line = decode(LogLine, by_topic[LOG][0].data)
    assert (line.level, line.event, line.fields) == ("info", "start", {"why": "None"})
    with open_recording(run) as recording:
        assert recording.settings == hall()
        assert len(list(recording.messages())) == len(entries)
        assert recording.finished


@pytest.mark.compiled
def test_segments_are_recorded_as_changes_that_add_up(run: Path) -> None:
    entries = [decode(MapChange, e.data) for e in entries_of(run) if e.topic == SEGMENTS]
    held: dict[int, tuple[float, ...]] = {}
    at_keyframes = 0
    for change in entries:
        before, held = held, {} if change.whole else held
        for number in change.removed:
            del held[number]
        held |= {change.first + i: row for i, row in enumerate(change.added)}
        at_keyframes += change.whole and len(before) > 0
    assert at_keyframes >= 4
    state = verify_file(run).state
    assert state is not None
    assert len(held) == pytest.approx(len(state.perception.segment_geometry()), abs=3)
    changes = [len(change.added) for change in entries if not change.whole]
    assert statistics.median(changes) < 0.5 * len(held), "only what is new"


def test_the_stock_reader_reads_it_and_messages_fit_their_schemas(run: Path) -> None:
    with run.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        seen: dict[str, int] = {}
        validators: dict[int, Any] = {}
        for schema, channel, message in reader.iter_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            if schema.id not in validators:
                found = json.loads(schema.data)
                jsonschema.Draft202012Validator.check_schema(found)
                validators[schema.id] = jsonschema.Draft202012Validator(found)
            if channel.topic != CYCLE or message.sequence % 10 == 0:
                validators[schema.id].validate(json.loads(message.data))
            seen[channel.topic] = seen.get(channel.topic, 0) + 1
        assert summary.statistics.message_count == sum(seen.values()) == len(entries_of(run))
    assert set(seen) == set(CHANNELS) - {SETTINGS, BOOKMARK, BOOKMARK_WITHDRAWN}
    with run.open("rb") as file:
        assert sum(1 for _ in NonSeekingReader(file, validate_crcs=True).iter_messages()) == sum(seen.values())


@pytest.mark.compiled
def test_what_does_not_fit_into_the_queue_is_dropped_and_counted(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    settings = hall()
    recorder = Recorder(settings, SingleFile(path), clock=lambda: 0.0, queue_max=40)
    assert settings.world is not None
    # The writer starts in the middle of the run: until then the queue overflows, afterwards nothing is lost.
    count = 0

    def on_state(cycle: Any, state: Any, _start: Any) -> None:
        nonlocal count
        count += 1
        if count == 100:
            recorder.__enter__()
        while count >= 100 and len(recorder._writer.thread._queue) > 20:
            time.sleep(0.001)
        recorder.on_cycle(cycle, state)

    simulate(settings, settings.world, 0, 10.0, on_state=on_state)
    recorder.__exit__(None, None, None)
    assert recorder.status.dropped >= 50
    result = verify_file(path)
    assert result.first_difference is None, str(result.first_difference)
    ((first, last),) = result.missing
    assert first <= 41
    assert 95 <= last <= 125
    assert result.cycles + result.skipped + (last - first + 1) == 200
    assert result.skipped <= 2, "a keyframe follows at once"


def test_the_loop_encodes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Encoding takes longer than handing over, so it is left to the writer's thread."""
    threads = set[threading.Thread]()

    def note(payload: Payload) -> bytes:
        threads.add(threading.current_thread())
        return encode(payload)

    monkeypatch.setattr("runtime.recording.writer.encode", note)
    status = record(hall("perception.method=paper"), tmp_path / "x.mcap", 2.0)
    assert status.messages > 40
    (writer,) = threads
    assert writer is not threading.main_thread()


class Full(SingleFile):
    """A disk that is full, and stays so."""

    def begin_part(self, part: int) -> Path:  # noqa: ARG002 - always this one
        return Path("/dev/full")


def test_a_full_disk_is_reported_and_the_run_continues() -> None:
    status = record(hall(), Full(Path()), 3.0)
    assert status.last_error is not None
    assert "No space left" in status.last_error
    assert status.dropped > 20


def test_a_folder_that_cannot_be_created_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    settings = hall()
    status = record(settings, RotatingFolder(tmp_path / "file", "run", settings.recording), 1.0)
    assert status.last_error is not None
    assert str(tmp_path / "file") in status.last_error
    assert status.file is None


@pytest.mark.compiled
def test_the_folder_keeps_its_cap_and_every_part_replays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Small chunks are written as soon as they are full, however late the writer's thread runs.
    monkeypatch.setattr("runtime.recording.mcap_file.CHUNK_BYTES", 16 * 1024)
    settings = hall("recording.cap_mb=1.0", "recording.keep=3", "recording.keyframe_period_s=0.5")
    old = [tmp_path / f"2000-{k}.mcap" for k in range(5)]
    for path in old:
        create_listed(path)
    (tmp_path / "notes.txt").write_text("not a recording")
    place = RotatingFolder(tmp_path, "run", settings.recording)

    class Unhurried(RotatingFolder):
        """Ends a part after a twentieth of the cap, because a short run never fills one."""

        def is_part_full(self, part_bytes: int) -> bool:
            return part_bytes > 50_000

    status = record(settings, Unhurried(place.folder, place.run, place.config), SECONDS)
    assert status.last_error is None
    parts = sorted(tmp_path.glob("*.mcap"))
    assert status.files >= 3
    assert not any(path.exists() for path in old[:3]), "three runs are kept, with this one"
    sizes = [path.stat().st_size for path in parts]
    assert sum(sizes) <= MEGABYTE + 2 * max(sizes), "the current part, and one that has been named"
    parts = [part for part in parts if part not in old]
    assert (tmp_path / "notes.txt").exists()
    results = [verify_file(part) for part in parts[-3:]]
    for result in results:
        assert result.first_difference is None, str(result.first_difference)
        assert result.skipped == 0
    # The last part may hold no cycle.
    assert sum(result.cycles > 0 for result in results) >= len(results) - 1
    assert place.is_part_full(250_001)
    assert not place.is_part_full(249_999)


def test_the_run_info_comes_first_and_before_every_keyframe(run: Path) -> None:
    entries = entries_of(run)
    assert entries[0].topic == RUN_INFO
    frames = [i for i, entry in enumerate(entries) if entry.topic == KEYFRAME]
    assert all(entries[i - 1].topic == RUN_INFO for i in frames)


@pytest.mark.parametrize("seed", range(4))
def test_each_undo_leaves_bookmarks_and_pins_as_they_were(tmp_path: Path, seed: int) -> None:
    """Over random bookmarks and undos."""
    rng, settings, undone = random.Random(seed), hall("perception.method=paper"), 0
    held, had_pin = list[str](), rng.random() < 0.5
    with Recorder(settings, RotatingFolder(tmp_path, "run", settings.recording), clock=lambda: 0.0) as recorder:
        until(lambda: recorder.status.is_writing, "a file")
        path = Path(str(recorder.status.file))
        if had_pin:  # by the operator
            pin_of(path).touch()
        for step in range(40):
            if rng.random() < 0.5:
                assert recorder.bookmark(f"mark  {step}") is None
                held.append(f"mark {step}")
            elif held:
                assert recorder.undo_bookmark() == held.pop()
                undone += 1
            else:
                with pytest.raises(UserError, match="there is no bookmark"):
                    recorder.undo_bookmark()
            until(lambda: is_pinned(path) == (had_pin or bool(held)), "the pin")
        assert recorder.bookmark("last") is None
        recorder.set_enabled(on=False)
        with pytest.raises(UserError, match="'last' is finished"):
            recorder.undo_bookmark()
    assert undone >= 5
    with open_recording(path) as recording:
        topics = [message.topic for message in recording.messages()]
    assert topics.count(BOOKMARK) - topics.count(BOOKMARK_WITHDRAWN) == len(held) + 1
    assert topics.count(BOOKMARK_WITHDRAWN) == undone


def test_a_recording_whose_bookmarks_are_withdrawn_has_none(tmp_path: Path) -> None:
    settings = hall("perception.method=paper")
    with Recorder(settings, RotatingFolder(tmp_path, "run", settings.recording), clock=lambda: 0.0) as recorder:
        until(lambda: recorder.status.is_writing, "a file")
        assert recorder.bookmark("here") is None
        assert recorder.undo_bookmark() == "here"
    path = Path(str(recorder.status.file))
    assert not has_bookmark(path)
    assert not is_pinned(path)
