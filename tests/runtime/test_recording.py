"""Recordings: complete, described by their own schemas, replayed to the bit from anywhere, and never in the way."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from mcap.reader import NonSeekingReader, make_reader

from runtime.cli import call
from runtime.complaint import DONE, FAILED, WRONG_CALL
from runtime.recording.channels import (
    ABOUT,
    BOOKMARK,
    CHANNELS,
    CYCLE,
    KEYFRAME,
    LOG,
    MODE,
    SEGMENTS,
    SERIAL,
    SETTINGS,
    SUMMARY,
    decode,
    encode,
)
from runtime.recording.folder import OneFile, Rotating
from runtime.recording.forms import FORMAT, About, Cycle, Keyframe, LogLine, MapChange, SerialBytes, snapshot_in
from runtime.recording.reading import RecordingError, open_recording
from runtime.recording.recorder import Recorder
from runtime.recording.rerun import Verdict, fresh_state, replay
from runtime.simulate import simulate
from tests.recorded import entries_of, hall, record, rewrite

ROOT = Path(__file__).parents[2]
SECONDS = 12.0


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recorded") / "hall.mcap"
    standing = record(hall(), path, SECONDS)
    assert (standing.dropped, standing.trouble, standing.files) == (0, None, 1)
    assert standing.bytes == path.stat().st_size
    return path


def verdict_of(path: Path, **span: float) -> Verdict:
    with open_recording(path) as recording:
        verdict = replay(recording, **span)  # type: ignore[arg-type]
        assert recording.damage == []
    return verdict


@pytest.mark.compiled
def test_a_replay_is_the_run_to_the_bit(run: Path) -> None:
    verdict = verdict_of(run)
    assert verdict.first is None, str(verdict.first)
    assert (verdict.cycles, verdict.different, verdict.first_cycle) == (20 * SECONDS, 0, 1)
    assert set(verdict.refinement) >= {"budget", "converged", "nothing"}
    assert verdict.keyframes >= SECONDS / 2.0 - 2
    assert verdict.missing == []
    assert verdict.state is not None
    assert len(verdict.state.perception.objects()) >= 3


@pytest.mark.compiled
@pytest.mark.parametrize("since_s", [2.0, 4.5, 7.9, 11.0])
def test_so_is_one_from_a_keyframe(run: Path, since_s: float) -> None:
    whole, part = verdict_of(run), verdict_of(run, since_s=since_s)
    assert part.first is None, str(part.first)
    assert part.first_cycle is not None
    assert 20 * (since_s - 2.1) <= part.first_cycle <= 20 * since_s + 2
    assert part.cycles == 20 * SECONDS - part.first_cycle + 1
    assert whole.state is not None
    assert part.state is not None
    assert part.state.perception.objects() == whole.state.perception.objects()
    one, other = whole.state.perception.snapshot(), part.state.perception.snapshot()
    assert {name: array.tobytes() for name, array in one.items()} == {n: a.tobytes() for n, a in other.items()}


@pytest.mark.compiled
@pytest.mark.parametrize("since", ["0", "9"])
def test_so_is_one_in_a_process_of_its_own(run: Path, since: str, tmp_path: Path) -> None:
    summary = tmp_path / "summary.json"
    command = [sys.executable, "-m", "runtime.cli", "replay", str(run), "--verify", "--from", since]
    done = subprocess.run(
        [*command, "--json", str(summary)], env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True,
        text=True, timeout=120, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (DONE, "")
    told = json.loads(summary.read_bytes())
    assert told["verify"]["differences"] == 0
    assert told["cycles"] >= 20 * (SECONDS - float(since))


@pytest.mark.compiled
def test_the_papers_method_too(tmp_path: Path) -> None:
    path = tmp_path / "paper.mcap"
    record(hall("perception.method=paper"), path, 10.0)
    for since_s in (0.0, 5.0):
        verdict = verdict_of(path, since_s=since_s)
        assert verdict.first is None, str(verdict.first)
        assert verdict.cycles >= 20 * (10.0 - since_s)
        assert set(verdict.refinement) >= {"budget", "converged", "nothing"}


@pytest.mark.compiled
def test_the_first_difference_is_named(run: Path, tmp_path: Path) -> None:
    entries = entries_of(run)
    for i, entry in enumerate(entries):
        if entry.topic == CYCLE and (cycle := decode(Cycle, entry.data).record).cycle in {77, 90}:
            other = Cycle(record=replace(cycle, segments=cycle.segments + 1))
            entries[i] = entry._replace(data=encode(other))
    rewrite(entries, tmp_path / "x.mcap")
    verdict = verdict_of(tmp_path / "x.mcap")
    assert verdict.different == 2
    assert verdict.first is not None
    assert (verdict.first.cycle, verdict.first.field) == (77, "segments")
    assert verdict.first.recorded == int(str(verdict.first.replayed)) + 1


@pytest.mark.compiled
def test_a_memory_that_differs_is_named(run: Path, tmp_path: Path) -> None:
    """The map of a keyframe holds what no record tells: one bit of it is a difference."""
    entries = entries_of(run)
    where = [i for i, entry in enumerate(entries) if entry.topic == KEYFRAME][2]
    frame = decode(Keyframe, entries[where].data)
    memory = snapshot_in(frame)
    name = next(name for name in memory if name.endswith("hist"))
    from runtime.recording.forms import StateLeft, keyframe

    changed = memory[name].copy()
    changed.flat[0] = changed.flat[0] + 1e-9
    left = {f: getattr(frame.left, f) for f in StateLeft.model_fields}
    entries[where] = entries[where]._replace(data=encode(keyframe(frame.cycle, left, {**memory, name: changed})))
    rewrite(entries, tmp_path / "x.mcap")
    verdict = verdict_of(tmp_path / "x.mcap")
    assert verdict.different == 1
    assert verdict.first is not None
    assert (verdict.first.cycle, verdict.first.field.split("[")[0]) == (frame.cycle, f"memory {name}")


def test_everything_that_happened_is_in_it(run: Path) -> None:
    entries = entries_of(run)
    by_topic = {topic: [e for e in entries if e.topic == topic] for topic in CHANNELS}
    assert [topic for topic, found in by_topic.items() if not found] == [SETTINGS, BOOKMARK], "nobody asked for it"
    (end,) = by_topic[SUMMARY]
    assert json.loads(end.data) == {"summary": {"mode": "DRIVE", "cycles": 240.0}}
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
        assert len(list(recording.entries())) == len(entries)
        assert recording.finished


@pytest.mark.compiled
def test_segments_go_in_as_changes_and_add_up(run: Path) -> None:
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
    state = verdict_of(run).state
    assert state is not None
    assert len(held) == pytest.approx(len(state.perception.segments_now()), abs=3)
    changes = [len(change.added) for change in entries if not change.whole]
    assert statistics.median(changes) < 0.5 * len(held), "only what is new"


def test_the_stock_reader_reads_it_and_its_own_schemas_hold(run: Path) -> None:
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
                told = json.loads(schema.data)
                jsonschema.Draft202012Validator.check_schema(told)
                validators[schema.id] = jsonschema.Draft202012Validator(told)
            validators[schema.id].validate(json.loads(message.data))
            seen[channel.topic] = seen.get(channel.topic, 0) + 1
        assert summary.statistics.message_count == sum(seen.values()) == len(entries_of(run))
    assert set(seen) == set(CHANNELS) - {SETTINGS, BOOKMARK}
    with run.open("rb") as file:
        assert sum(1 for _ in NonSeekingReader(file, validate_crcs=True).iter_messages()) == sum(seen.values())


def test_what_does_not_fit_is_dropped_counted_and_got_over(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    settings = hall()
    recorder = Recorder(settings, OneFile(path), clock=lambda: 0.0, queue_max=40)
    assert settings.world is not None
    # Nothing takes from the queue until half of the run is over: then a thread does, and the rest gets through.
    count = 0

    def on_state(cycle: Any, state: Any, _start: Any) -> None:
        nonlocal count
        count += 1
        if count == 100:
            recorder.__enter__()
        while count >= 100 and len(recorder._writer.queue) > 20:
            time.sleep(0.001)
        recorder.on_cycle(cycle, state)

    simulate(settings, settings.world, 0, 10.0, on_state=on_state)
    recorder.__exit__(None, None, None)
    assert recorder.standing.dropped >= 50
    verdict = verdict_of(path)
    assert verdict.first is None, str(verdict.first)
    ((first, last),) = verdict.missing
    assert first <= 41
    assert 95 <= last <= 125
    assert verdict.cycles + verdict.skipped + (last - first + 1) == 200
    assert verdict.skipped <= 2, "a keyframe follows at once"


@pytest.mark.compiled
def test_the_loop_only_hands_over() -> None:
    """What the loop does a cycle is less than encoding the record would be."""
    settings = hall("recording.keyframe_period_s=3600.0")
    assert settings.world is not None
    handed, encoded = [], []
    recorder = Recorder(settings, OneFile(Path("/nowhere/at/all")), clock=lambda: 0.0)

    def on_state(cycle: Any, state: Any, _start: Any) -> None:
        began = time.perf_counter()
        recorder.on_cycle(cycle, state)
        handed.append(time.perf_counter() - began)
        began = time.perf_counter()
        encode(Cycle.model_construct(record=cycle))
        encoded.append(time.perf_counter() - began)

    simulate(settings, settings.world, 0, 5.0, on_state=on_state)
    assert statistics.median(handed) < statistics.median(encoded), (handed, encoded)


class Full(OneFile):
    """A disk that is full, and stays so."""

    def path(self, part: int) -> Path:  # noqa: ARG002 - always this one
        return Path("/dev/full")


def test_a_full_disk_is_told_and_nothing_waits_for_it() -> None:
    standing = record(hall(), Full(Path()), 3.0)
    assert standing.trouble is not None
    assert "No space left" in standing.trouble
    assert standing.dropped > 20


def test_a_folder_that_is_none_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    settings = hall()
    standing = record(settings, Rotating(tmp_path / "file", "run", settings.recording), 1.0)
    assert standing.trouble is not None
    assert str(tmp_path / "file") in standing.trouble
    assert standing.file is None


def test_the_folder_keeps_its_cap_and_every_part_replays(tmp_path: Path) -> None:
    settings = hall("recording.cap_mb=1.0", "recording.keep=3", "recording.keyframe_period_s=0.5")
    old = [tmp_path / f"2000-{k}.mcap" for k in range(5)]
    for k, path in enumerate(old):
        path.write_bytes(b"x" * 1000)
        os.utime(path, (k, k))
    (tmp_path / "notes.txt").write_text("not a recording")
    place = Rotating(tmp_path, "run", settings.recording)

    class Unhurried(Rotating):
        """A run in virtual time is over before a part is full: end one after each twentieth of the cap."""

        def is_full(self, part_bytes: int) -> bool:
            return part_bytes > 50_000

    standing = record(settings, Unhurried(place.folder, place.run, place.config), SECONDS)
    assert standing.trouble is None
    parts = sorted(tmp_path.glob("*.mcap"))
    assert standing.files >= 3
    assert len(parts) <= 3
    assert not any(path.exists() for path in old)
    assert (tmp_path / "notes.txt").exists()
    cycles = 0
    for part in parts:
        verdict = verdict_of(part)
        assert verdict.first is None, str(verdict.first)
        assert verdict.skipped == 0
        cycles += verdict.cycles
    assert cycles > 60
    assert place.is_full(250_001)
    assert not place.is_full(249_999)


def test_a_recording_under_way_is_not_deleted(tmp_path: Path) -> None:
    settings = hall("recording.cap_mb=1.0")
    current = tmp_path / "run-001.mcap"
    current.write_bytes(b"x" * 2_000_000)
    Rotating(tmp_path, "run", settings.recording).tidy(current)
    assert current.exists()


def test_other_settings_tell_what_would_have_been(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(["replay", str(run), "--set", "perception.method=paper", "--set", "cycle.rate_hz=20"]) == DONE
    out = capsys.readouterr().out
    assert out.index("as it was") < out.index("with the other settings")
    assert out.count("of 6 drums") == 2
    assert "0 with another command" in out


@pytest.mark.compiled
def test_other_settings_may_drive_otherwise(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    avoid = "behaviors.avoid_static_obstacle.avoid_obstacle_sphere_m=2.0"
    assert call(["replay", str(run), "--set", avoid]) == DONE
    assert " 0 with another command" not in capsys.readouterr().out


def test_a_state_that_is_put_back_is_whole(run: Path) -> None:
    """Also what is worked out from the memory and kept."""
    frames = [decode(Keyframe, e.data) for e in entries_of(run) if e.topic == KEYFRAME]
    with open_recording(run) as recording:
        state = fresh_state(recording.settings)
        assert state.perception.objects() == ()
        state.perception.restore(snapshot_in(frames[-1]))
        assert len(state.perception.objects()) >= 3
        other = fresh_state(hall("perception.full.tracks_max=7"))
        with pytest.raises(ValueError, match="of other settings"):
            other.perception.restore(snapshot_in(frames[-1]))
        with pytest.raises(ValueError, match="another method"):
            fresh_state(hall("perception.method=paper")).perception.restore(snapshot_in(frames[-1]))


def complaint(arguments: list[str], capsys: pytest.CaptureFixture[str], code: int) -> str:
    assert call(arguments) == code
    err = capsys.readouterr().err
    assert err.startswith("echolocate: ")
    assert err.count("\n") == 1, err
    return err


@pytest.mark.parametrize("command", ["replay", "recover"])
def test_files_that_are_no_recordings(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = {"empty.mcap": b"", "wrong.mcap": b"t,x,y,theta\n" * 99, "magic.mcap": b"\x89MCAP0\r\n"}
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
        assert name in complaint([command, str(tmp_path / name)], capsys, WRONG_CALL)
    assert "is empty" in complaint([command, str(tmp_path / "empty.mcap")], capsys, WRONG_CALL)
    assert "nowhere.mcap" in complaint([command, str(tmp_path / "nowhere.mcap")], capsys, WRONG_CALL)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(files)


def test_a_newer_file_and_a_strange_one(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(tmp_path / "x.mcap")
    entries = entries_of(run)
    about = decode(About, entries[0].data)
    newer = [entries[0]._replace(data=encode(about.model_copy(update={"format": FORMAT + 1}))), *entries[1:]]
    rewrite(newer, Path(path), f"echolocate/{FORMAT + 1}")
    assert "newer program" in complaint(["replay", path], capsys, WRONG_CALL)
    odd = about.model_copy(update={"settings": {**about.settings, "warp": 9}})
    rewrite([entries[0]._replace(data=encode(odd)), *entries[1:]], Path(path))
    assert "warp" in complaint(["replay", path], capsys, WRONG_CALL)
    from mcap.writer import Writer

    with Path(path).open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "other")
        writer.finish()
    assert "ros2" in complaint(["replay", path], capsys, WRONG_CALL)
    with pytest.raises(RecordingError), open_recording(Path(path)):
        pass


def test_calls_that_make_no_sense(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "--to" in complaint(["replay", str(run), "--from", "5", "--to", "4"], capsys, WRONG_CALL)
    assert "--speed" in complaint(["replay", str(run), "--speed", "0"], capsys, WRONG_CALL)
    assert "--verify" in complaint(["replay", str(run), "--verify", "--with", "irregular"], capsys, WRONG_CALL)
    assert "warp" in complaint(["replay", str(run), "--set", "warp=9"], capsys, WRONG_CALL)
    assert "itself" in complaint(["recover", str(run), "--out", str(run)], capsys, WRONG_CALL)
    assert "nowhere" in complaint(["recover", str(run), "--out", str(tmp_path / "nowhere" / "x")], capsys, FAILED)
    (tmp_path / "x.csv").write_text("t,x,y,theta,r00\n0,0,0,0,1\n")
    assert "ring log" in complaint(["replay", str(tmp_path / "x.csv"), "--verify"], capsys, WRONG_CALL)


@pytest.mark.compiled
def test_a_replay_to_watch_keeps_its_pace(run: Path) -> None:
    began_s = time.monotonic()
    assert call(["replay", str(run), "--verify", "--speed", "5", "--from", "8", "--to", "11"]) == DONE
    assert time.monotonic() - began_s > 0.5


def test_about_comes_first_and_with_every_keyframe(run: Path) -> None:
    entries = entries_of(run)
    assert entries[0].topic == ABOUT
    frames = [i for i, entry in enumerate(entries) if entry.topic == KEYFRAME]
    assert all(entries[i - 1].topic == ABOUT for i in frames)
