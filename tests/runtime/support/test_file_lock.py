"""Tests of the file lock: one process at a time, also after one was killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from config.errors import FAILED, UserError
from runtime.support.file_lock import file_lock, is_locked

ROOT = Path(__file__).parents[3]
HOLD = "import sys, pathlib\nfrom runtime.support.file_lock import file_lock\n" + (
    "with file_lock(pathlib.Path(sys.argv[1]), 'x'):\n    print('held', flush=True)\n    sys.stdin.read()\n"
)
KILLS = 8


def holder(path: Path) -> subprocess.Popen[bytes]:
    process = subprocess.Popen([sys.executable, "-c", HOLD, str(path)], stdin=subprocess.PIPE,
                               stdout=subprocess.PIPE, cwd=ROOT)  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == b"held\n"
    return process


def kill(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.communicate()


def is_free(path: Path) -> bool:
    try:
        with file_lock(path, "x"):
            return True
    except UserError:
        return False


@pytest.mark.promise("P13")
def test_a_second_process_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text("kept")
    first = holder(path)
    try:
        with pytest.raises(UserError) as caught, file_lock(path, f"--record {path}"):
            pass
    finally:
        kill(first)
    assert caught.value.exit_code == FAILED
    line = str(caught.value)
    assert line.startswith(f"--record {path}: another process writes to this file; ")
    assert f"fuser {path}" in line
    assert path.read_text() == "kept"


@pytest.mark.promise("P13")
def test_a_killed_process_leaves_no_lock(tmp_path: Path, record_property: Callable[[str, object], None]) -> None:
    """A killed holder leaves the file, and no lock on it."""
    path = tmp_path / "run.csv"
    for _ in range(KILLS):
        first = holder(path)
        assert not is_free(path)
        first.send_signal(signal.SIGKILL)
        first.communicate()
        assert is_free(path)
    record_property("measured", f"{KILLS} holders killed: the file was locked while each was alive, free afterwards")


def test_a_file_that_was_replaced_is_another_file(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    first = holder(path)
    try:
        (tmp_path / "new").write_text("")
        (tmp_path / "new").replace(path)
        assert is_free(path)
    finally:
        kill(first)


def test_a_file_replaced_again_and_again_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.csv"
    monkeypatch.setattr(os.path, "samestat", lambda *_: False)
    assert not is_free(path)


def test_the_lock_is_released_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    with file_lock(path, "x"):
        assert not is_free(path)
    assert is_free(path)


def test_pipes_and_devices_are_not_locked(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    for path in (tmp_path / "fifo", Path(os.devnull)):
        with file_lock(path, "x"):
            assert is_free(path)


@pytest.mark.parametrize("name", [".", "no/such/folder/run.csv", "x" * 300])
def test_an_unwritable_path_is_refused(tmp_path: Path, name: str) -> None:
    with (
        pytest.raises(UserError, match=r"^--record x: cannot be written: .*; choose another file$"),
        file_lock(tmp_path / name, "--record x"),
    ):
        pass


def test_a_lock_is_seen_while_it_is_held(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    assert not is_locked(path)
    with file_lock(path, "--record"):
        assert is_locked(path)
    assert not is_locked(path)
    assert not is_locked(Path("/dev/null"))
