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


def test_what_a_robot_lacks_is_left_out_and_named(tmp_path: Path) -> None:
    """In a folder without a clone: one part of the contract, which shows what the others do."""
    (tmp_path / "mine.py").write_text(FAMILY)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "drivers.contract.plugin"]
    environment = {**os.environ, "PYTHONPATH": f"{tmp_path}:{ROOT}"}
    done = subprocess.run(
        [*command, "--echolocate-family", "mine:FAMILY", "-k", "motion and (wrong or halt_stops or nothing_moves)"],
        cwd=tmp_path, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 passed, 4 skipped" in done.stdout
    assert "denning: it reports no contact" in done.stdout
