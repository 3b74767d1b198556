"""A recovered file holds every whole chunk of a damaged recording, is closed properly, and replays."""

from __future__ import annotations

from pathlib import Path

import pytest
from mcap.stream_reader import StreamReader

from config.errors import DONE
from runtime.cli.app import run_command
from runtime.recording.channels import CYCLE, decode
from runtime.recording.reader import RecordingError, open_recording
from runtime.recording.recovery import recover
from runtime.recording.schema import Cycle
from runtime.recording.verification import verify_recording
from tests.recorded import chunks_at, entries_of, scanned


def test_a_replay_continues_at_the_keyframe_after_a_lost_chunk(chunked_run: Path, tmp_path: Path) -> None:
    data = bytearray(chunked_run.read_bytes())
    begin, end = chunks_at(bytes(data))[6]
    data[(begin + end) // 2] ^= 0xFF
    path = tmp_path / "x.mcap"
    path.write_bytes(data)
    with open_recording(path) as recording:
        result = verify_recording(recording)
        assert [region.offset for region in recording.corrupt_regions] == [begin]
    assert result.first_difference is None, str(result.first_difference)
    assert result.missing == [(61, 70)]
    assert 10 <= result.skipped <= 20
    assert result.cycles + result.skipped == 230


def test_a_recovered_file_is_whole(chunked_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = chunked_run.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: int(0.7 * len(data))])
    assert run_command(["recover", str(cut)]) == DONE
    assert "was not closed" in capsys.readouterr().out
    restored = tmp_path / "cut-recovered.mcap"
    before, after = entries_of(cut), entries_of(restored)
    assert before == after
    assert scanned(restored.read_bytes())[1].finished
    assert run_command(["replay", str(restored), "--verify"]) == DONE
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cut-recovered.mcap", "cut.mcap"]
    with restored.open("rb") as file:
        assert sum(1 for _ in StreamReader(file, validate_crcs=True, emit_chunks=True).records) > 10


def test_recovering_twice_changes_nothing(chunked_run: Path, tmp_path: Path) -> None:
    first = recover(chunked_run, tmp_path / "1.mcap")
    second = recover(tmp_path / "1.mcap", tmp_path / "2.mcap")
    assert (first.finished, first.corrupt_regions) == (True, ())
    assert (first.messages, first.cycles, first.chunks) == (second.messages, 240, second.chunks)
    assert (tmp_path / "1.mcap").read_bytes() == (tmp_path / "2.mcap").read_bytes()


def test_a_recording_without_its_first_chunk_is_recovered(chunked_run: Path, tmp_path: Path) -> None:
    """The first chunk holds schemas and channels; settings are repeated with each keyframe."""
    data = bytearray(chunked_run.read_bytes())
    begin, end = chunks_at(bytes(data))[0]
    data[end - 3] ^= 0xFF
    (tmp_path / "x.mcap").write_bytes(data)
    got = recover(tmp_path / "x.mcap", tmp_path / "y.mcap")
    assert [region.offset for region in got.corrupt_regions] == [begin]
    cycles = [decode(Cycle, e.data).record.cycle for e in entries_of(tmp_path / "y.mcap") if e.topic == CYCLE]
    assert cycles == list(range(11, 241))
    with open_recording(tmp_path / "y.mcap") as recording:
        result = verify_recording(recording)
    assert result.first_difference is None
    assert result.missing == [(1, 10)]
    assert result.cycles >= 150


def test_nothing_is_left_of_a_recovery_that_fails(chunked_run: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(chunked_run.read_bytes()[:60])
    with pytest.raises(RecordingError, match="holds no whole chunk"):
        recover(cut, tmp_path / "restored.mcap")
    with pytest.raises(FileNotFoundError):
        recover(chunked_run, tmp_path / "none" / "restored.mcap")
    assert list(tmp_path.iterdir()) == [cut]
