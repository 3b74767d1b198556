"""The tutorial's commands run as they are written; the drive itself only in the long form."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from config.errors import DONE
from runtime.cli.app import run_command

TUTORIAL = (Path(__file__).parents[3] / "docs" / "tutorial.md").read_text("utf-8")
COMMANDS = [line for block in re.findall(r"```console\n(.*?)```", TUTORIAL, re.DOTALL) for line in block.splitlines()]
CHEAP = ("init", "check", "service")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the working directory, with the files that the tutorial shows."""
    monkeypatch.chdir(tmp_path)
    for name, text in re.findall(r'```toml title="([\w.-]+)"\n(.*?)```', TUTORIAL, re.DOTALL):
        (tmp_path / name).write_text(text)
    return tmp_path


def test_the_files_of_the_first_hour_are_written_and_good(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    done = []
    for line in COMMANDS:
        program, *words = shlex.split(line.partition(" > ")[0])
        if program == "echolocate" and words[0] in CHEAP:
            assert run_command(words) == DONE, (line, capsys.readouterr().err)
            done.append(words[0])
    assert done == ["init", "init", "init", "init", "check", "service"]
    printed = capsys.readouterr().out
    assert "my-run.toml: good" in printed
    assert "ExecReload=/bin/kill -HUP $MAINPID" in printed
    assert "WantedBy=default.target" in printed
    assert "DynamicUser" not in printed
    assert tomllib.loads((here / "my-robot.toml").read_text())["robot"] == {"name": "Ella", "driver": "denning"}
    assert len(tomllib.loads((here / "my-route.toml").read_text())["step"]) == 4


@pytest.mark.soak
def test_the_whole_first_hour(here: Path) -> None:
    """Every command, one after the other, the drive in real time."""
    program = f"{shlex.quote(sys.executable)} -m runtime.cli "
    for line in COMMANDS:
        command = line.replace("echolocate ", program, 1) if line.startswith("echolocate ") else line
        done = subprocess.run(["bash", "-c", command], cwd=here, capture_output=True, text=True, check=False)
        assert done.returncode == DONE, (line, done.stderr)
    report = (here / "first.html").read_text("utf-8")
    assert "objects found" in report
    assert '"walls"' in (here / "found.json").read_text("utf-8")
