"""A folder of one's own to load files from."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the working directory hold nothing but what the test puts there."""
    monkeypatch.chdir(tmp_path)
