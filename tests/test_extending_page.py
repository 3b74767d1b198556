"""The page on extending: its files and commands work in an empty folder, its changes in a copy of this repository."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from config.errors import DONE
from runtime.cli.app import run_command
from tests.installed import install, install_editable

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "extending.md").read_text("utf-8")
SECTIONS = dict(re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", PAGE, re.MULTILINE | re.DOTALL))
PACKAGES = ("An object model", "A motor schema", "A robot")
CHANGES = ("A recorded field", "A field of the page")
CHEAP = ("init", "check", "settings")
PROGRAM = f"{shlex.quote(sys.executable)} -m runtime.cli "
TESTS = f"{shlex.quote(sys.executable)} -m pytest --disable-plugin-autoload -p echolocate_pytest "
RUN = " --headless --no-console --seconds 5"
"""For a drive that a test can end."""


def files(section: str) -> list[tuple[str, str]]:
    """Return the files that a section shows, with their names."""
    return re.findall(r'```toml title="([\w.-]+)"\n(.*?)```', SECTIONS[section], re.DOTALL)


def commands(section: str) -> list[str]:
    """Return the commands of a section, in order."""
    blocks = re.findall(r"```console\n(.*?)```", SECTIONS[section], re.DOTALL)
    return [line for block in blocks for line in block.splitlines()]


def changes(section: str) -> list[tuple[str, str, str]]:
    """Return file, old and new text of each change that a section shows."""
    found = []
    for name, text in re.findall(r'```diff title="([\w/.]+)"\n(.*?)```', SECTIONS[section], re.DOTALL):
        lines = text.splitlines(keepends=True)
        old, new = ("".join(line[1:] for line in lines if line[0] in signs) for signs in (" -", " +"))
        found.append((name, old, new))
    return found


def test_the_table_names_each_task() -> None:
    rows = re.findall(r"^\| \[.+?\]\(#(.+?)\)", PAGE, re.MULTILINE)
    assert rows == [name.lower().replace(" ", "-") for name in (*PACKAGES, *CHANGES)]
    for name in (*PACKAGES, *CHANGES):
        assert "| place | to leave out? |" in SECTIONS[name]


@pytest.mark.parametrize("section", PACKAGES)
def test_what_a_package_or_a_file_adds_is_written_and_good_in_an_empty_folder(
    section: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in files(section):
        (tmp_path / name).write_text(text)
    done = []
    for line in commands(section):
        program, *words = shlex.split(line)
        if program == "pip":
            folder = tmp_path / words[words.index("-e") + 1]
            install_editable(folder)
            install(monkeypatch, folder, {}, {})
        elif program == "echolocate" and words[0] in CHEAP:
            assert run_command(words) == DONE, (line, capsys.readouterr().err)
            done.append(words[0])
    assert "check" in done
    printed = capsys.readouterr().out
    assert ": good" in printed
    assert ("skippy: [skippy] report_s = 0.05\n" in printed) == (section == "A robot")


@pytest.mark.parametrize("section", CHANGES)
def test_each_change_fits_one_place(section: str) -> None:
    assert len(changes(section)) == 2
    for name, old, new in changes(section):
        assert (ROOT / name).read_text("utf-8").count(old) == 1, (name, old)
        assert old != new


@pytest.mark.soak
@pytest.mark.parametrize("section", PACKAGES)
def test_every_command_works_in_an_empty_folder(section: str, tmp_path: Path) -> None:
    """As written, but that a drive ends after seconds and an installation is its entry points."""
    for name, text in files(section):
        (tmp_path / name).write_text(text)
    path = [str(ROOT)]
    for line in commands(section):
        if line.startswith("pip "):
            folder = tmp_path / shlex.split(line)[shlex.split(line).index("-e") + 1]
            install_editable(folder)
            path.insert(0, str(folder))
            continue
        command = re.sub(r"^echolocate ", PROGRAM, re.sub(r"^pytest ", TESTS, line))
        command += RUN if line.startswith("echolocate run") else ""
        environment = {**os.environ, "PYTHONPATH": ":".join(path), "XDG_STATE_HOME": str(tmp_path / "state")}
        done = subprocess.run(
            ["bash", "-c", command], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == DONE, (line, done.stdout, done.stderr)


@pytest.mark.soak
@pytest.mark.parametrize("section", CHANGES)
def test_each_change_is_whole_in_a_copy_of_the_repository(section: str, tmp_path: Path) -> None:
    """With the page's changes and commands its own tests pass, and so do those that the quick check would run."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    for name in listed.splitlines():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    for name, old, new in changes(section):
        file = tmp_path / name
        file.write_text(file.read_text("utf-8").replace(old, new), "utf-8")
    environment = {**os.environ, "PYTHONPATH": ""}
    for line in commands(section):
        command = re.sub(r"^python ", f"{shlex.quote(sys.executable)} ", line)
        done = subprocess.run(
            ["bash", "-c", command], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, (line, done.stdout, done.stderr)
