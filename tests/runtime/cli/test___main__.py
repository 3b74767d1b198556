"""Tests of the command as a program of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from config.errors import DONE, WRONG_CALL
from runtime.cli.__main__ import ARRAY_THREADS
from tests.runtime.cli.user_errors import error_lines

ROOT = Path(__file__).parents[3]
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != ARRAY_THREADS} | {"PYTHONPATH": str(ROOT)}
WITHOUT_MATPLOTLIB = """
import os, sys, runtime.cycle.process, runtime.recording.recorder
from runtime.cli import app
from runtime.cli.__main__ import ARRAY_THREADS, main
assert "matplotlib" not in sys.modules
run = app.main
def run_with_one_thread():
    assert os.environ[ARRAY_THREADS] == "1"
    run()
app.main = run_with_one_thread
sys.argv[1:] = ["check", "hallway"]
main()
"""


def test_a_wrong_call_as_a_program() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "runtime.cli", "check", "halway"], env=ENVIRONMENT, text=True, capture_output=True,
        check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (WRONG_CALL, "")
    assert len(error_lines(done.stderr)) == 1


def test_a_closed_pipe_is_no_traceback_and_a_run_loads_neither_matplotlib_nor_threads_for_arrays() -> None:
    """As in `echolocate check hallway | true`. Matplotlib takes half a second to load, and no cycle uses it."""
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as out:
        done = subprocess.run(
            [sys.executable, "-c", WITHOUT_MATPLOTLIB], env=ENVIRONMENT, stdout=out, stderr=subprocess.PIPE,
            text=True, check=False,
        )  # fmt: skip
    assert (done.returncode, done.stderr) == (DONE, "")


@pytest.mark.promise("P28")
def test_a_working_directory_that_was_removed(tmp_path: Path) -> None:
    script = "import os, sys; os.rmdir(os.getcwd()); from runtime.cli.__main__ import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", script], env=ENVIRONMENT, cwd=tmp_path, text=True, capture_output=True, check=False
    )
    assert (done.returncode, done.stdout) == (WRONG_CALL, "")
    assert error_lines(done.stderr) == ["echolocate: the working directory has been removed; change into another one"]
