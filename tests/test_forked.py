"""Tests of the forked processes: each test is run once and reported, whatever becomes of its process."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from tests.forked import made_once, shared_numbers, taken

ROOT = Path(__file__).resolve().parents[1]
CONFTEST = """
import pytest
from tests.forked import ForkedTests

def pytest_configure(config):
    config.pluginmanager.register(
        ForkedTests(2, lambda item: "_b" in item.path.name, lambda session: print("prepared"),
                    lambda n: print(f"process {n} is over")))
"""
PASSING = """
import pytest

@pytest.fixture(scope="module", autouse=True)
def module(tmp_path_factory):
    print("begins")
    yield
    (tmp_path_factory.getbasetemp() / "ended").touch()

@pytest.mark.parametrize("n", range(20))
def test_passes(n, tmp_path, capfd):
    print(n)
    assert capfd.readouterr().out == f"{n}\\n"
    assert not list(tmp_path.parent.glob("*/seen"))
    (tmp_path / f"seen by {n}").touch()

def test_fails():
    print("what it printed")
    assert 1 == 2

def test_is_skipped():
    pytest.skip("for a reason")
"""
KILLED = """
import os, signal

def test_before():
    pass

def test_dies():
    os.kill(os.getpid(), signal.SIGKILL)

def test_after():
    pass
"""


def run_suite(folder: Path, *arguments: str, **files: str) -> tuple[int, str]:
    """Run a suite of these files in two processes; return the exit code and what it printed."""
    (folder / "pytest.ini").write_text("[pytest]\n")
    (folder / "conftest.py").write_text(CONFTEST)
    for name, text in files.items():
        (folder / f"test_{name}.py").write_text(text)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--basetemp", "temp", *arguments]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def test_every_test_is_run_and_reported_but_those_of_a_process_that_is_killed(tmp_path: Path) -> None:
    code, out = run_suite(tmp_path, a=PASSING, b=PASSING.replace("1 == 2", "1 == 1"), c=PASSING, d=KILLED)
    assert code == 1, out
    assert "3 failed, 62 passed, 3 skipped" in out, out
    assert "what it printed" in out
    assert "FAILED test_d.py::test_dies - the process that ran it ended with status -9" in out
    assert "not run, because a process had ended:\ntest_d.py::test_after" in out
    assert out.count("prepared") == 1
    assert len(re.findall("process . is over", out)) == 1, "the other process went on"
    assert {path.name for path in (tmp_path / "temp").iterdir()} == {"process0", "process1"}


def test_the_first_failure_ends_all_if_asked_for(tmp_path: Path) -> None:
    code, out = run_suite(tmp_path, "-x", a=PASSING.replace("def test_passes", "def unused"), b=PASSING)
    assert code == 1
    assert "stopping after 1 failures" in out, out


def test_a_file_that_cannot_be_imported_runs_nothing(tmp_path: Path) -> None:
    code, out = run_suite(tmp_path, a=PASSING, b="import nowhere_at_all")
    assert code == 2, out
    assert "prepared" not in out
    assert "passed" not in out


def test_each_number_is_taken_once() -> None:
    pipes = shared_numbers(range(4000)), shared_numbers(range(4000, 5000))
    lists = [list[int]() for _ in range(3)]
    threads = [threading.Thread(target=lambda mine=mine: mine.extend(taken(*pipes))) for mine in lists]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for pipe in pipes:
        os.close(pipe)
    assert sorted(number for mine in lists for number in mine) == list(range(5000))


class Folders:
    """Temporary folders of a process."""

    def __init__(self, own: Path) -> None:
        self.own = own

    def getbasetemp(self) -> Path:
        return self.own

    def mktemp(self, name: str) -> Path:
        (self.own / name).mkdir(parents=True)
        return self.own / name


def test_a_file_is_made_once_and_each_process_has_its_own_copy(tmp_path: Path) -> None:
    made: list[Path] = []

    def make(path: Path) -> None:
        made.append(path)
        time.sleep(0.05)  # meanwhile the others ask for it
        path.write_text("a recording")

    processes: list[Any] = [Folders(tmp_path / f"process{number}") for number in range(3)]
    with ThreadPoolExecutor(3) as pool:
        copies = list(pool.map(lambda folders: made_once(folders, "run", make), processes))
    assert copies == [tmp_path / f"process{number}" / "run" / "hall.mcap" for number in range(3)]
    assert [path.read_text() for path in copies] == 3 * ["a recording"]
    assert len(made) == 1
