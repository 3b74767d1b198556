"""Recordings as files: their state, names, pins and deletion; nothing outside the folder is reached."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

import pytest

from config.errors import UserError
from runtime.recording.folder_files import (
    delete_recording,
    describe_recordings,
    pin_recording,
    rename_recording,
)
from runtime.recording.folder_index import listed_names
from runtime.recording.mcap_file import McapFile
from runtime.recording.storage import pin_of
from tests.runtime.recording.test_extent import START_NS, written


def test_the_list_says_what_is_live_complete_and_pinned(tmp_path: Path) -> None:
    assert describe_recordings(tmp_path / "none") == []
    written(tmp_path / "done.mcap", finish=True)
    written(tmp_path / "cut.mcap", finish=False)
    live = McapFile(tmp_path / "live.mcap", b"{}", START_NS)
    os.utime(live.path, ns=(START_NS, START_NS))
    pin_recording(tmp_path, "done.mcap", pinned=True)
    found = {one.file: (one.state, one.pinned, one.duration_s is not None) for one in describe_recordings(tmp_path)}
    live.abandon()
    assert found == {
        "done.mcap": ("complete", True, True),
        "cut.mcap": ("incomplete", False, True),
        "live.mcap": ("live", False, True),
    }


def test_a_renamed_recording_keeps_its_content_its_pin_and_its_place_in_the_index(tmp_path: Path) -> None:
    path = written(tmp_path / "20260101T000000Z-1-001.mcap", finish=True)
    content = path.read_bytes()
    pin_recording(tmp_path, path.name, pinned=True)
    assert rename_recording(tmp_path, path.name, "dock, run 2") == "dock, run 2.mcap"
    new = tmp_path / "dock, run 2.mcap"
    assert (new.read_bytes(), path.exists(), pin_of(path).exists(), pin_of(new).exists()) == (
        content, False, False, True,
    )  # fmt: skip
    assert new.name in listed_names(tmp_path)
    foreign = tmp_path / "mine.mcap"
    foreign.write_bytes(content)
    rename_recording(tmp_path, "mine.mcap", "still-mine.mcap")
    assert "still-mine.mcap" not in listed_names(tmp_path), "a file that no run wrote is never removed to make room"


BAD_NAMES = ("", ".mcap", "../up", "a/b", ".hidden", "-x", "a\0b", "a\nb", "x" * 101, "naïve/..", "~", "$(x)")


@pytest.mark.parametrize("name", BAD_NAMES)
def test_a_name_that_leads_elsewhere_is_refused(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "runs"
    folder.mkdir()
    written(folder / "a.mcap", finish=True)
    (tmp_path / "up.mcap").write_bytes(b"not of the folder")
    with pytest.raises(UserError):
        rename_recording(folder, "a.mcap", name)
    for act in (lambda n: delete_recording(folder, n), lambda n: pin_recording(folder, n, pinned=True),
                lambda n: rename_recording(folder, n, "b")):  # fmt: skip
        for wrong in (name, "../up.mcap", str(tmp_path / "up.mcap"), "none.mcap"):
            with pytest.raises(UserError, match="there is no recording"):
                act(wrong)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["runs", "up.mcap"]
    assert [p.name for p in folder.iterdir() if p.suffix == ".mcap"] == ["a.mcap"]


def test_nothing_is_overwritten_and_what_is_live_or_pinned_stays(tmp_path: Path) -> None:
    a, b = (written(tmp_path / f"{name}.mcap", finish=True) for name in "ab")
    content = b.read_bytes()
    with pytest.raises(UserError, match=r"there is a recording b\.mcap already"):
        rename_recording(tmp_path, "a.mcap", "b")
    assert (a.exists(), b.read_bytes()) == (True, content)
    with a.open("rb") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        for act in (lambda: delete_recording(tmp_path, "a.mcap"), lambda: rename_recording(tmp_path, "a.mcap", "c")):
            with pytest.raises(UserError, match="is being written: stop recording first"):
                act()
    pin_recording(tmp_path, "a.mcap", pinned=True)
    with pytest.raises(UserError, match="is pinned: unpin it first"):
        delete_recording(tmp_path, "a.mcap")
    pin_recording(tmp_path, "a.mcap", pinned=False)
    delete_recording(tmp_path, "a.mcap")
    assert [p.name for p in tmp_path.iterdir() if p.suffix == ".mcap"] == ["b.mcap"]
