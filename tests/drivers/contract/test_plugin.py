"""The contract runs on a robot outside this repository: by its name, with what it lacks left out and named."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
FAMILY = """
from drivers.contract.family import family_of
FAMILY = family_of("denning", has=frozenset({"deadman", "latch"}), connect_s=0.3)
"""
OF_THEIRS = """
import drivers
def test_theirs():
    assert drivers.MINE == 1
"""


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run pytest in a folder that is no clone, as one does beside which this package is installed."""
    options = "-q -p no:cacheprovider --disable-plugin-autoload -p echolocate_pytest"
    command = [sys.executable, "-m", "pytest", *options.split(), *words]
    environment = {**os.environ, "PYTHONPATH": f"{folder}:{ROOT}"}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_what_a_robot_lacks_is_left_out_and_named(tmp_path: Path) -> None:
    """In a folder without a clone: one part of the contract, which shows what the others do."""
    (tmp_path / "mine.py").write_text(FAMILY)
    some = "motion and (wrong or halt_stops or nothing_moves)"
    done = run(tmp_path, "--echolocate-family", "mine:FAMILY", "-k", some)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 passed, 4 skipped" in done.stdout
    assert "denning: it reports no contact" in done.stdout


def test_a_project_with_packages_of_our_names_is_tested_as_without_us(tmp_path: Path) -> None:
    """The option says what is in its way there."""
    (tmp_path / "drivers").mkdir()
    (tmp_path / "drivers" / "__init__.py").write_text("MINE = 1\n")
    (tmp_path / "test_theirs.py").write_text(OF_THEIRS)
    done = run(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 passed" in done.stdout
    done = run(tmp_path, "--echolocate-family", "denning")
    assert done.returncode == 4, done.stdout + done.stderr
    assert "drivers/__init__.py hides echolocate's own package 'drivers'" in done.stderr


def test_a_robot_that_there_is_not_is_said_once(tmp_path: Path) -> None:
    done = run(tmp_path, "--echolocate-family", "nonesuch")
    assert done.returncode == 4, done.stdout + done.stderr
    assert '--echolocate-family nonesuch: robot "nonesuch": no such robot' in done.stderr
