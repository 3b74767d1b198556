"""A user without a home folder."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest

from runtime.support import user_folders


@pytest.fixture
def homeless(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Let this process be one of a user without an entry in the list of users; return its working directory."""

    def no_entry(user: int | str) -> None:
        raise KeyError(user)

    for name in ("HOME", "XDG_STATE_HOME", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("pwd.getpwuid", no_entry)
    monkeypatch.setattr("pwd.getpwnam", no_entry)
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    monkeypatch.chdir(tmp_path)
    user_folders._temporary_folder.cache_clear()
    return tmp_path
