"""Runs in the six-drum hallway, recorded once in a run of all tests: to replay and to analyse, also as a ring log."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import DONE
from runtime.cli.app import run_command
from tests.forked import made_once
from tests.recorded import SECONDS, hall, record


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def make(path: Path) -> None:
        status = record(hall(), path, SECONDS)
        assert (status.dropped, status.last_error, status.files) == (0, None, 1)
        assert status.bytes == path.stat().st_size

    return made_once(tmp_path_factory, "recorded", make)


@pytest.fixture(scope="session")
def hall_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def make(path: Path) -> None:
        assert record(hall(), path, 14.0).dropped == 0

    return made_once(tmp_path_factory, "shown", make)


@pytest.fixture(scope="session")
def hall_log(hall_run: Path) -> Path:
    path = hall_run.with_suffix(".csv")
    assert run_command(["export", str(hall_run), "--to", "ringlog", "--out", str(path)]) == DONE
    return path
