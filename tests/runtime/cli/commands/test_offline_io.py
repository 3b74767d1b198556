"""Tests of what the commands on finished runs share: reading files, optional packages."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from rich.console import Console

from config.errors import WRONG_CALL, UserError
from runtime.analysis.timeline_sources import TimelineSource
from runtime.cli.commands.offline_io import plain_console, read_timeline, require_package

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


def test_a_missing_package_names_how_to_install_it() -> None:
    require_package("json", "json", "export")
    with pytest.raises(UserError, match=r"pip install 'echolocate\[extra\]'") as caught:
        require_package("no_such_module_here", "the-package", "extra")
    assert "pip install the-package" in str(caught.value)
