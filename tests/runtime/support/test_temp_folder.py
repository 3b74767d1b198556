"""Tests of the folder of a run: removed at its end, or by the next start if it was killed; no other is touched."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from runtime.support.temp_folder import PREFIX, YOUNG_S, remove_stale_folders, temp_folder

ROOT = Path(__file__).parents[3]
OWNER = """
import sys, time
from runtime.support.temp_folder import temp_folder
with temp_folder() as folder:
    (folder / "robot").symlink_to("/dev/null")
    sys.stdout.write(f"{folder}\\n")
    sys.stdout.flush()
    sys.stdin.read()
"""


@pytest.fixture(autouse=True)
def _place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)


def aged(folder: Path, by_s: float = 2.0 * YOUNG_S) -> Path:
    now_s = folder.stat().st_mtime
    os.utime(folder, (now_s - by_s, now_s - by_s))
    return folder


def owner() -> tuple[subprocess.Popen[str], Path]:
    process = subprocess.Popen(
        [sys.executable, "-c", OWNER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT
    )
    assert process.stdout is not None
    return process, Path(process.stdout.readline().strip())


def test_only_the_user_can_enter_it_and_it_is_removed_at_the_end(tmp_path: Path) -> None:
    with temp_folder() as folder:
        assert folder.parent == tmp_path
        assert folder.stat().st_mode & 0o777 == 0o700
        (folder / "robot").symlink_to("/dev/null")
    assert list(tmp_path.iterdir()) == []
    assert Path("/dev/null").exists()


def test_the_folder_of_a_killed_run_is_removed_by_the_next_start(tmp_path: Path) -> None:
    process, folder = owner()
    with process:
        aged(folder)
        remove_stale_folders()
        assert (folder / "robot").is_symlink(), "its owner is alive"
        process.kill()
    assert folder.exists()
    with temp_folder() as own:
        assert list(tmp_path.iterdir()) == [own]


def test_other_folders_are_kept(tmp_path: Path) -> None:
    young = tmp_path / f"{PREFIX}young"
    young.mkdir()
    link, elsewhere = tmp_path / f"{PREFIX}link", tmp_path / "elsewhere"
    elsewhere.mkdir()
    link.symlink_to(aged(elsewhere))
    os.utime(link, (0.0, 0.0), follow_symlinks=False)
    file = tmp_path / f"{PREFIX}file"
    file.touch()
    os.utime(file, (0.0, 0.0))
    others = {young, link, file, elsewhere, aged(Path(tempfile.mkdtemp(prefix="echolocate-bench-")))}
    remove_stale_folders()
    assert set(tmp_path.iterdir()) == others
