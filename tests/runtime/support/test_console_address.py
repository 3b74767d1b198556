"""Each run's address is found while it lasts; its file is its owner's alone and goes with the run."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from config.errors import UserError
from runtime.support.console_address import FOLDER, NEWEST, announced, find_console, find_consoles
from runtime.support.file_lock import file_lock

URL = "http://127.0.0.1:8765/?token=abc"
OTHER = "http://127.0.0.1:1/?token=x"


def another_run(folder: Path, number: int, url: str) -> Path:
    """Write the file of another process's run, older than those of this one."""
    path = folder / FOLDER / str(number)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch(0o600)
    path.write_text(f"{url}\n")
    os.utime(path, ns=(number, number))
    return path


def test_a_run_is_found_while_it_lasts(tmp_path: Path) -> None:
    folder = tmp_path / "state"
    with announced(URL, folder):
        assert find_consoles(folder) == [URL]
        (file,) = (folder / FOLDER).iterdir()
        for path in (file, folder / NEWEST):
            assert path.stat().st_mode & 0o077 == 0
            assert path.read_text() == f"{URL}\n"
    assert [path for path in folder.rglob("*") if path.is_file()] == []
    with pytest.raises(UserError, match="start `echolocate run`"):
        find_consoles(folder)


def test_the_newest_of_several_runs_comes_first_and_the_others_outlive_it(tmp_path: Path) -> None:
    with file_lock(another_run(tmp_path, 2, OTHER), "older"), file_lock(another_run(tmp_path, 1, "oldest"), "oldest"):
        with announced(URL, tmp_path):
            assert find_consoles(tmp_path) == [URL, OTHER, "oldest"]
            assert (tmp_path / NEWEST).read_text() == f"{URL}\n"
        assert find_console(tmp_path) == OTHER
        assert (tmp_path / NEWEST).read_text() == f"{OTHER}\n"


def test_what_a_killed_run_leaves_counts_for_nothing(tmp_path: Path) -> None:
    left = another_run(tmp_path, 1, OTHER)
    with pytest.raises(UserError, match="no run"):
        find_consoles(tmp_path)
    with announced(URL, tmp_path):
        assert find_consoles(tmp_path) == [URL]
        assert not left.exists()


def test_a_run_whose_address_is_not_yet_written_is_none(tmp_path: Path) -> None:
    starting = another_run(tmp_path, 1, "")
    starting.write_text("")
    with file_lock(starting, "starting"), pytest.raises(UserError, match="no run"):
        find_consoles(tmp_path)


def test_what_cannot_be_removed_or_is_just_being_made_stops_no_run(tmp_path: Path) -> None:
    (tmp_path / FOLDER / "folder").mkdir(parents=True)
    young = tmp_path / FOLDER / "1"
    young.touch(0o600)
    with announced(URL, tmp_path):
        assert find_consoles(tmp_path) == [URL]
        assert young.exists()


def test_an_address_that_others_can_read_is_refused(tmp_path: Path) -> None:
    with announced(URL, tmp_path):
        next((tmp_path / FOLDER).iterdir()).chmod(0o644)
        with pytest.raises(UserError, match="delete this file"):
            find_consoles(tmp_path)


def test_a_folder_that_cannot_be_written_stops_no_run(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with announced(URL, tmp_path / "file"):
        pass
