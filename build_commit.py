"""Builds wheels and source distributions; the commit of the clone goes with them, for `echolocate --version`."""

from __future__ import annotations

import subprocess
from pathlib import Path

from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

ROOT = Path(__file__).resolve().parent
KEPT = Path("runtime", "support", "commit.txt")
"""Where `runtime.support.build` looks for it. A source distribution has it already."""


def keep_commit(folder: Path) -> None:
    """Write the commit of this clone below a folder; without a clone, or without git, write nothing."""
    if not (ROOT / ".git").exists():
        return
    command = ["git", "-C", str(ROOT), "describe", "--always", "--abbrev=10", "--dirty=+", "--exclude=*"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)  # noqa: S603 - a fixed command
    except (OSError, subprocess.SubprocessError):
        return
    (folder / KEPT).parent.mkdir(parents=True, exist_ok=True)
    (folder / KEPT).write_text(done.stdout, encoding="utf-8")


class BuildPy(build_py):
    """Builds the packages, with the commit."""

    def run(self) -> None:
        """Build; an editable installation has the clone itself."""
        super().run()
        if not self.editable_mode:
            keep_commit(Path(self.build_lib))


class SourceDistribution(sdist):
    """Builds the source distribution, with the commit."""

    def make_release_tree(self, base_dir: str, files: list[str]) -> None:
        """Copy the files, and add the commit."""
        super().make_release_tree(base_dir, files)
        keep_commit(Path(base_dir))
