"""Tests of what the commands on finished runs share: reading files, and checking where output goes."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from rich.console import Console

from config.errors import FAILED, WRONG_CALL, UserError
from runtime.analysis.timeline_sources import TimelineSource
from runtime.cli.commands.offline_io import (
    make_output_folder,
    plain_console,
    read_timeline,
    refuse_overwriting,
    refuse_unwritable,
    require_package,
    writing,
)

UNREADABLE = {
    "empty.mcap": b"",
    "cut.mcap": b"\x89MCAP0\r\n",
    "wrong.mcap": b"hello\n",
    "empty.csv": b"",
    "wrong.csv": b"a,b\n1,2\n",
    "bare.csv": b"t,x,y,theta,r00\n",
}


@pytest.mark.parametrize("name", [*UNREADABLE, "nowhere.mcap", "nowhere.csv"])
def test_a_file_that_cannot_be_shown_is_named(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    if name in UNREADABLE:
        path.write_bytes(UNREADABLE[name])
    with pytest.raises(UserError, match=re.escape(name)) as caught:
        read_timeline(TimelineSource(str(path)), Console(quiet=True))
    assert caught.value.exit_code == WRONG_CALL


def test_a_console_for_paths_neither_wraps_nor_colours(capsys: pytest.CaptureFixture[str]) -> None:
    line = f"/{'long/' * 60}run.mcap: 12 cycles"
    plain_console().print(line)
    plain_console(stderr=True).print(line)
    assert capsys.readouterr() == (f"{line}\n", f"{line}\n")


def test_an_os_error_names_option_and_path() -> None:
    with (
        pytest.raises(UserError, match=r"^--out x: cannot be written: No space left; choose another") as caught,
        writing("--out", "x"),
    ):
        raise OSError(28, "No space left")
    assert caught.value.exit_code == FAILED


def test_a_file_is_tried_before_the_work_and_keeps_its_content(tmp_path: Path) -> None:
    (tmp_path / "old.json").write_text("{}")
    refuse_unwritable({"--json": str(tmp_path / "old.json"), "--record": None})
    assert (tmp_path / "old.json").read_text() == "{}"
    refuse_unwritable({"--json": str(tmp_path / "new.json")})
    assert not (tmp_path / "new.json").exists()
    with pytest.raises(
        UserError, match=r"^--json .*/no/x: cannot be written: .*; choose another place or make room$"
    ) as caught:
        refuse_unwritable({"--json": str(tmp_path / "no" / "x")})
    assert caught.value.exit_code == FAILED


def test_an_output_folder_is_made_with_its_parents(tmp_path: Path) -> None:
    assert make_output_folder(str(tmp_path / "a" / "b")).is_dir()
    assert make_output_folder(str(tmp_path / "a" / "b")) == tmp_path / "a" / "b"
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match="is a file") as caught:
        make_output_folder(str(tmp_path / "file"))
    assert caught.value.exit_code == WRONG_CALL
    with pytest.raises(UserError, match="cannot be written"):
        make_output_folder(str(tmp_path / "file" / "deeper"))


def test_the_input_is_not_overwritten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    refuse_overwriting("a.mcap", tmp_path / "b.mcap")
    with pytest.raises(UserError, match="is the input itself"):
        refuse_overwriting("a.mcap", tmp_path / "a.mcap")


def test_a_missing_package_names_how_to_install_it() -> None:
    require_package("json", "json", "export")
    with pytest.raises(UserError, match=r"pip install 'echolocate\[extra\]'") as caught:
        require_package("no_such_module_here", "the-package", "extra")
    assert "pip install the-package" in str(caught.value)
