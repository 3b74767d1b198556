"""The index of a folder: complete, in order, and read to a bounded size."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from runtime.recording import folder_index
from runtime.recording.folder_index import INDEX, create_listed, is_finished_recording, listed_names
from runtime.recording.mcap_file import McapFile


def test_files_are_listed_in_the_order_of_their_creation(tmp_path: Path) -> None:
    assert listed_names(tmp_path) == []
    for name in ("b.mcap", "a.mcap"):
        create_listed(tmp_path / name)
    assert listed_names(tmp_path) == ["b.mcap", "a.mcap"]
    (tmp_path / "b.mcap").unlink()
    create_listed(tmp_path / "b.mcap")
    assert listed_names(tmp_path) == ["b.mcap", "a.mcap"], "once each"


def test_an_existing_file_is_neither_touched_nor_listed(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"mine")
    (tmp_path / "b.mcap").symlink_to(tmp_path / "nowhere")
    for name in ("a.mcap", "b.mcap"):
        with pytest.raises(FileExistsError):
            create_listed(tmp_path / name)
    assert (tmp_path / "a.mcap").read_bytes() == b"mine"
    assert not (tmp_path / "nowhere").exists()
    assert listed_names(tmp_path) == []


def test_a_file_that_cannot_be_listed_is_not_left_over(tmp_path: Path) -> None:
    for plant in (lambda index: index.mkdir(), lambda index: index.symlink_to("/dev/full"), os.mkfifo):
        folder = tmp_path / f"{len(list(tmp_path.iterdir()))}"
        folder.mkdir()
        plant(folder / INDEX)
        with pytest.raises(OSError, match=INDEX):
            create_listed(folder / "a.mcap")
        assert not (folder / "a.mcap").exists()


def test_a_line_that_a_full_disk_cut_off_spoils_no_other(tmp_path: Path) -> None:
    (tmp_path / INDEX).write_bytes(b"\n\xff.mcap\n\ncut o")
    create_listed(tmp_path / "a.mcap")
    assert listed_names(tmp_path) == ["\udcff.mcap", "cut o", "a.mcap"]


def test_the_end_of_a_long_index_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for k in range(10):
        create_listed(tmp_path / f"{k}.mcap")
    monkeypatch.setattr(folder_index, "INDEX_MAX", 3 * len("\n7.mcap\n"))
    assert listed_names(tmp_path) == ["7.mcap", "8.mcap", "9.mcap"]


def test_only_a_finished_recording_of_ours_is_one(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    assert not is_finished_recording(path)
    file = McapFile(path, b"{}", 0)
    assert not is_finished_recording(path), "it is being written"
    file.finish()
    assert is_finished_recording(path)
    os.mkfifo(tmp_path / "pipe.mcap")
    (tmp_path / "link.mcap").symlink_to(path)
    (tmp_path / "folder.mcap").mkdir()
    (tmp_path / "other.mcap").write_bytes(path.read_bytes().replace(b"echolocate/", b"echolocatf/"))
    (tmp_path / "short.mcap").write_bytes(path.read_bytes()[:20])
    for name in ("pipe", "link", "folder", "other", "short"):
        assert not is_finished_recording(tmp_path / f"{name}.mcap")
