"""A run among the six drums and its firings as a ring log, recorded once for all tests that show it."""

from __future__ import annotations

from pathlib import Path

import pytest

from runtime.cli import call
from runtime.complaint import DONE
from tests.recorded import hall, record


@pytest.fixture(scope="session")
def hall_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("shown") / "hall.mcap"
    assert record(hall(), path, 14.0).dropped == 0
    return path


@pytest.fixture(scope="session")
def hall_log(hall_run: Path) -> Path:
    path = hall_run.with_suffix(".csv")
    assert call(["export", str(hall_run), "--to", "ringlog", "--out", str(path)]) == DONE
    return path
