"""Which build of the program runs: its version, the commit of a clone, and the packages that results depend on."""

from __future__ import annotations

import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

from runtime import VERSION

ROOT: Final = Path(__file__).resolve().parents[2]
KEPT: Final = Path(__file__).with_name("commit.txt")
"""What `build_commit.py` writes into a wheel."""
PACKAGES: Final = ("numba", "numpy")
GIT_TIMEOUT_S: Final = 2.0


def describe_build() -> str:
    """Return the version in one line, as in ``1.0.0 (commit 1a2b3c4d5e, Python 3.11.9, numba 0.68.1)``."""
    commit = commit_of(ROOT) or kept_commit(KEPT)
    parts = [f"commit {commit}"] if commit else []
    parts.append(f"Python {platform.python_version()}")
    parts += [f"{name} {version_of(name)}" for name in PACKAGES]
    return f"{VERSION} ({', '.join(parts)})"


def kept_commit(file: Path) -> str | None:
    """Return the commit that a wheel was built from, None in a clone."""
    try:
        return file.read_text("utf-8").strip()[:40] or None
    except (OSError, ValueError):
        return None


def version_of(package: str) -> str:
    """Return the version of an installed package."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "missing"


def commit_of(root: Path) -> str | None:
    """Return the commit of a clone, with a ``+`` where files differ from it; None elsewhere, or without git."""
    if not (root / ".git").exists():  # git itself would find the repository of a project around it
        return None
    command = ["git", "-C", str(root), "describe", "--always", "--abbrev=10", "--dirty=+", "--exclude=*"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=GIT_TIMEOUT_S, check=True)  # noqa: S603 - a fixed command
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip() or None
