"""The newest run is found by its address; the file is its owner's alone and goes with the run."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import UserError
from runtime.support.console_address import NAME, announced, find_console

URL = "http://127.0.0.1:8765/?token=abc"


def test_a_run_is_found_while_it_lasts(tmp_path: Path) -> None:
    folder = tmp_path / "state"
    with announced(URL, folder):
        assert find_console(folder) == URL
        assert (folder / NAME).stat().st_mode & 0o077 == 0
        assert [path.name for path in folder.iterdir()] == [NAME]
    with pytest.raises(UserError, match="start `echolocate run`"):
        find_console(folder)


def test_the_newest_of_two_runs_counts_and_the_older_leaves_its_address(tmp_path: Path) -> None:
    with announced("http://127.0.0.1:1/?token=x", tmp_path), announced(URL, tmp_path):
        pass
    with announced(URL, tmp_path):
        with announced("http://127.0.0.1:1/?token=x", tmp_path):
            pass
        with pytest.raises(UserError):
            find_console(tmp_path)


def test_an_address_that_others_can_read_is_refused(tmp_path: Path) -> None:
    with announced(URL, tmp_path):
        (tmp_path / NAME).chmod(0o644)
        with pytest.raises(UserError, match="delete this file"):
            find_console(tmp_path)


def test_a_folder_that_cannot_be_written_stops_no_run(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with announced(URL, tmp_path / "file"):
        pass
