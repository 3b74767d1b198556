"""Runs in the six-drum hallway, recorded once per worker process: to replay and to analyse, also as a ring log."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import DONE
from runtime.cli.app import run_command
from tests.recorded import SECONDS, hall, record


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recorded") / "hall.mcap"
    status = record(hall(), path, SECONDS)
    assert (status.dropped, status.last_error, status.files) == (0, None, 1)
    assert status.bytes == path.stat().st_size
    return path


@pytest.fixture(scope="session")
def hall_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("shown") / "hall.mcap"
    assert record(hall(), path, 14.0).dropped == 0
    return path


@pytest.fixture(scope="session")
def hall_log(hall_run: Path) -> Path:
    path = hall_run.with_suffix(".csv")
    assert run_command(["export", str(hall_run), "--to", "ringlog", "--out", str(path)]) == DONE
    return path
