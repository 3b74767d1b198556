"""The description of the build: the commit of a clone and nothing of a repository around it."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from runtime.support.build import commit_of, describe_build, kept_commit, version_of
from tests.hil.machine import TIMEOUT_S


def git(folder: Path, *arguments: str) -> None:
    identity = ("-c", "user.name=t", "-c", "user.email=t@example.org", "-c", "commit.gpgsign=false")
    subprocess.run(["git", "-C", str(folder), *identity, *arguments], check=True, capture_output=True)


def test_the_line_names_version_python_and_packages() -> None:
    assert re.fullmatch(r"\d+\.\d+\.\d+ \(.*Python 3\.\d+\.\d+, numba [\d.]+, numpy [\d.]+\)", describe_build())
    assert version_of("no-such-package") == "missing"


def test_the_commit_of_a_clone_and_whether_files_differ(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("runtime.support.build.GIT_TIMEOUT_S", TIMEOUT_S)
    assert commit_of(tmp_path) is None
    git(tmp_path, "init", "--quiet")
    assert commit_of(tmp_path) is None, "no commit yet"
    (tmp_path / "file").write_text("1", "utf-8")
    git(tmp_path, "add", "file")
    git(tmp_path, "commit", "--quiet", "-m", "first")
    clean = commit_of(tmp_path)
    assert clean is not None
    assert re.fullmatch("[0-9a-f]{10}", clean)
    (tmp_path / "file").write_text("2", "utf-8")
    assert commit_of(tmp_path) == f"{clean}+"
    inner = tmp_path / "inner"
    inner.mkdir()
    assert commit_of(inner) is None, "installed within another repository"


def test_a_wheel_names_the_commit_that_it_was_built_from(tmp_path: Path) -> None:
    assert kept_commit(tmp_path / "commit.txt") is None
    (tmp_path / "commit.txt").write_text("1a2b3c4d5e+\n", "utf-8")
    assert kept_commit(tmp_path / "commit.txt") == "1a2b3c4d5e+"
