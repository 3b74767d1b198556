"""Where recordings are written: names of parts, the limits of a folder, and the files that it offers."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from config.settings import RecordingConfig
from runtime.recording.storage import (
    MEGABYTE,
    RotatingFolder,
    SingleFile,
    find_recording,
    list_recordings,
    recordings_folder,
)

CONFIG = RecordingConfig(cap_mb=1.0, keep=3)


def write(path: Path, size: int, modified_s: int) -> Path:
    path.write_bytes(bytes(size))
    os.utime(path, (modified_s, modified_s))
    return path


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_of_the_user_is_never_split_or_deleted(tmp_path: Path) -> None:
    target = SingleFile(tmp_path / "run.mcap")
    assert [target.path(part).name for part in (1, 2, 11)] == ["run.mcap", "run-2.mcap", "run-11.mcap"]
    assert not target.is_part_full(10**15)
    old = write(tmp_path / "old.mcap", 10, 1)
    target.enforce_limits(target.path(1))
    assert old.exists()


def test_a_new_part_makes_room_by_deleting_the_oldest(tmp_path: Path) -> None:
    folder = tmp_path / "runs"
    target = RotatingFolder(folder, "run", CONFIG)
    assert target.path(1) == folder / "run-001.mcap"
    for k in range(5):
        write(folder / f"{k}.mcap", 10, k)
    (folder / "notes.txt").write_text("not a recording")
    assert target.path(2).name == "run-002.mcap"
    assert names(folder) == ["3.mcap", "4.mcap", "notes.txt"], "room for one more"


def test_the_folder_stays_below_its_size_without_the_current_file(tmp_path: Path) -> None:
    target = RotatingFolder(tmp_path, "run", CONFIG)
    write(tmp_path / "old.mcap", 10, 1)
    current = write(tmp_path / "run-001.mcap", 2 * MEGABYTE, 2)
    new = write(tmp_path / "other.mcap", 10, 3)
    target.enforce_limits(current)
    assert current.exists()
    assert names(tmp_path) == ["run-001.mcap"]
    assert not new.exists()


def test_within_the_limits_nothing_is_deleted(tmp_path: Path) -> None:
    target = RotatingFolder(tmp_path, "run", CONFIG)
    for k in range(3):
        write(tmp_path / f"{k}.mcap", MEGABYTE // 3, k)
    target.enforce_limits(tmp_path / "2.mcap")
    assert len(names(tmp_path)) == 3


def test_a_part_ends_at_its_share_of_the_limit(tmp_path: Path) -> None:
    target = RotatingFolder(tmp_path, "run", CONFIG)
    assert target.is_part_full(250_001)
    assert not target.is_part_full(250_000)


def test_only_files_of_the_folder_are_recordings(tmp_path: Path) -> None:
    assert list_recordings(tmp_path / "none") == []
    (tmp_path / "folder.mcap").mkdir()
    (tmp_path / "log.jsonl").touch()
    assert list_recordings(tmp_path) == []
    write(tmp_path / "old.mcap", 3, 100)
    write(tmp_path / "b.mcap", 0, 200)
    write(tmp_path / "a.mcap", 7, 200)
    assert list_recordings(tmp_path) == [("a.mcap", 7, 200.0), ("b.mcap", 0, 200.0), ("old.mcap", 3, 100.0)]
    assert find_recording(tmp_path, "old.mcap") == tmp_path / "old.mcap"
    for name in ("", "none.mcap", "folder.mcap", "../old.mcap", str(tmp_path / "old.mcap"), "log.jsonl"):
        assert find_recording(tmp_path, name) is None


def test_the_folder_of_recordings(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/robot")
    monkeypatch.setenv("XDG_STATE_HOME", "/home/robot/state")
    assert recordings_folder(RecordingConfig(folder="~/runs")) == Path("/home/robot/runs")
    assert recordings_folder(RecordingConfig()) == Path("/home/robot/state/echolocate/runs")
