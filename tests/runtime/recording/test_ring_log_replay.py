"""Recordings replayed: to the bit from anywhere, with other settings, and what is said of files that cannot be."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from config.errors import DONE, FAILED, WRONG_CALL
from runtime.cli.app import run_command
from runtime.recording.channels import (
    CYCLE,
    KEYFRAME,
    decode,
    encode,
)
from runtime.recording.reader import RecordingError, open_recording
from runtime.recording.replayer import fresh_state
from runtime.recording.schema import FORMAT, Cycle, Keyframe, RunInfo, perception_snapshot
from tests.recorded import SECONDS, entries_of, hall, record, rewrite, verify_file

ROOT = Path(__file__).parents[3]


@pytest.mark.compiled
def test_a_replay_is_the_run_to_the_bit(run: Path) -> None:
    result = verify_file(run)
    assert result.first_difference is None, str(result.first_difference)
    assert (result.cycles, result.differences, result.first_cycle) == (20 * SECONDS, 0, 1)
    assert set(result.refinement_stops) >= {"budget", "converged", "nothing"}
    assert result.keyframes >= SECONDS / 2.0 - 2
    assert result.missing == []
    assert result.state is not None
    assert len(result.state.perception.objects()) >= 3


@pytest.mark.compiled
@pytest.mark.parametrize("since_s", [2.0, 4.5, 7.9, 11.0])
def test_so_is_one_from_a_keyframe(run: Path, since_s: float) -> None:
    whole, part = verify_file(run), verify_file(run, since_s=since_s)
    assert part.first_difference is None, str(part.first_difference)
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
    found = json.loads(summary.read_bytes())
    assert found["verify"]["differences"] == 0
    assert found["cycles"] >= 20 * (SECONDS - float(since))


@pytest.mark.compiled
def test_the_papers_method_too(tmp_path: Path) -> None:
    path = tmp_path / "paper.mcap"
    record(hall("perception.method=paper"), path, 10.0)
    for since_s in (0.0, 5.0):
        result = verify_file(path, since_s=since_s)
        assert result.first_difference is None, str(result.first_difference)
        assert result.cycles >= 20 * (10.0 - since_s)
        assert set(result.refinement_stops) >= {"budget", "converged", "nothing"}


@pytest.mark.compiled
def test_the_first_difference_is_named(run: Path, tmp_path: Path) -> None:
    entries = entries_of(run)
    for i, entry in enumerate(entries):
        if entry.topic == CYCLE and (cycle := decode(Cycle, entry.data).record).cycle in {77, 90}:
            other = Cycle(record=replace(cycle, segments=cycle.segments + 1))
            entries[i] = entry._replace(data=encode(other))
    rewrite(entries, tmp_path / "x.mcap")
    result = verify_file(tmp_path / "x.mcap")
    assert result.differences == 2
    assert result.first_difference is not None
    assert (result.first_difference.cycle, result.first_difference.field) == (77, "segments")
    assert result.first_difference.recorded == int(str(result.first_difference.replayed)) + 1


@pytest.mark.compiled
def test_a_memory_that_differs_is_named(run: Path, tmp_path: Path) -> None:
    """The map of a keyframe holds what no record holds: one bit of it is a difference."""
    entries = entries_of(run)
    where = [i for i, entry in enumerate(entries) if entry.topic == KEYFRAME][2]
    frame = decode(Keyframe, entries[where].data)
    memory = perception_snapshot(frame)
    name = next(name for name in memory if name.endswith("memory.state"))
    from runtime.recording.schema import keyframe, state_fields

    changed = memory[name].copy()
    changed["sensors"]["history"]["range_m"][0, 0, 0] += 1e-9
    altered = keyframe(frame.cycle, frame.run_s, state_fields(frame), {**memory, name: changed})
    entries[where] = entries[where]._replace(data=encode(altered))
    rewrite(entries, tmp_path / "x.mcap")
    result = verify_file(tmp_path / "x.mcap")
    assert result.differences == 1
    assert result.first_difference is not None
    assert (result.first_difference.cycle, result.first_difference.field.split("[")[0]) == (
        frame.cycle,
        f"perception {name}",
    )


def test_comparison_with_other_settings(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["replay", str(run), "--set", "perception.method=paper", "--set", "cycle.rate_hz=20"]) == DONE
    out = capsys.readouterr().out
    assert out.index("as it was") < out.index("with the other settings")
    assert out.count("of 6 drums") == 2
    assert "0 with another command" in out


@pytest.mark.compiled
def test_other_settings_may_drive_otherwise(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    avoid = "behaviors.avoid_static_obstacle.avoid_obstacle_sphere_m=2.0"
    assert run_command(["replay", str(run), "--set", avoid]) == DONE
    assert " 0 with another command" not in capsys.readouterr().out


def test_a_state_that_is_put_back_is_whole(run: Path) -> None:
    """Also what is worked out from the memory and kept."""
    frames = [decode(Keyframe, e.data) for e in entries_of(run) if e.topic == KEYFRAME]
    with open_recording(run) as recording:
        state = fresh_state(recording.settings)
        assert state.perception.objects() == ()
        state.perception.restore(perception_snapshot(frames[-1]))
        assert len(state.perception.objects()) >= 3
        other = fresh_state(hall("perception.bayes.tracks_max=7"))
        with pytest.raises(ValueError, match="of other settings"):
            other.perception.restore(perception_snapshot(frames[-1]))
        with pytest.raises(ValueError, match="another method"):
            fresh_state(hall("perception.method=paper")).perception.restore(perception_snapshot(frames[-1]))


def error_message(arguments: list[str], capsys: pytest.CaptureFixture[str], code: int) -> str:
    assert run_command(arguments) == code
    err = capsys.readouterr().err
    assert err.startswith("echolocate: ")
    assert err.count("\n") == 1, err
    return err


@pytest.mark.parametrize("command", ["replay", "recover"])
def test_files_that_are_no_recordings(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = {"empty.mcap": b"", "wrong.mcap": b"t,x,y,theta\n" * 99, "magic.mcap": b"\x89MCAP0\r\n"}
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
        assert name in error_message([command, str(tmp_path / name)], capsys, WRONG_CALL)
    assert "is empty" in error_message([command, str(tmp_path / "empty.mcap")], capsys, WRONG_CALL)
    assert "nowhere.mcap" in error_message([command, str(tmp_path / "nowhere.mcap")], capsys, WRONG_CALL)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(files)


def test_a_newer_file_and_a_strange_one(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(tmp_path / "x.mcap")
    entries = entries_of(run)
    about = decode(RunInfo, entries[0].data)
    newer = [entries[0]._replace(data=encode(about.model_copy(update={"format": FORMAT + 1}))), *entries[1:]]
    rewrite(newer, Path(path), f"echolocate/{FORMAT + 1}")
    assert f"has recording format {FORMAT + 1} " in error_message(["replay", path], capsys, WRONG_CALL)
    odd = about.model_copy(update={"settings": {**about.settings, "warp": 9}})
    rewrite([entries[0]._replace(data=encode(odd)), *entries[1:]], Path(path))
    assert "warp" in error_message(["replay", path], capsys, WRONG_CALL)
    from mcap.writer import Writer

    with Path(path).open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "other")
        writer.finish()
    assert "ros2" in error_message(["replay", path], capsys, WRONG_CALL)
    with pytest.raises(RecordingError), open_recording(Path(path)):
        pass


def test_calls_that_make_no_sense(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "--to" in error_message(["replay", str(run), "--from", "5", "--to", "4"], capsys, WRONG_CALL)
    assert "--speed" in error_message(["replay", str(run), "--speed", "0"], capsys, WRONG_CALL)
    assert "--verify" in error_message(["replay", str(run), "--verify", "--with", "irregular"], capsys, WRONG_CALL)
    assert "warp" in error_message(["replay", str(run), "--set", "warp=9"], capsys, WRONG_CALL)
    assert "itself" in error_message(["recover", str(run), "--out", str(run)], capsys, WRONG_CALL)
    assert "nowhere" in error_message(["recover", str(run), "--out", str(tmp_path / "nowhere" / "x")], capsys, FAILED)
    (tmp_path / "x.csv").write_text("t,x,y,theta,r00\n0,0,0,0,1\n")
    assert "ring log" in error_message(["replay", str(tmp_path / "x.csv"), "--verify"], capsys, WRONG_CALL)


@pytest.mark.compiled
def test_a_replay_to_watch_keeps_its_pace(run: Path) -> None:
    began_s = time.monotonic()
    assert run_command(["replay", str(run), "--verify", "--speed", "5", "--from", "8", "--to", "11"]) == DONE
    assert time.monotonic() - began_s > 0.5
