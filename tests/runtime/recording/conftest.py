"""The shared run in small chunks, for tests that damage one, and writers that wait for busy machines."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import pytest

from tests.forked import made_once
from tests.hil.machine import TIMEOUT_S
from tests.recorded import entries_of, rewrite
from tests.runtime.recording.edited_run import record_edited


@pytest.fixture(scope="session", autouse=True)
def _patient_writers() -> Iterator[None]:
    """Give a busy machine a minute to write the end of a file."""
    with (
        mock.patch("runtime.recording.writer.CLOSE_MAX_S", TIMEOUT_S),
        mock.patch("runtime.recording.ring_log_writer.CLOSE_MAX_S", TIMEOUT_S),
    ):
        yield


@pytest.fixture(scope="session")
def chunked_run(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the recording of 240 cycles in chunks of ten, with a keyframe every two seconds."""
    path = tmp_path_factory.mktemp("chunked") / "hall.mcap"
    rewrite(entries_of(run), path)
    return path


@pytest.fixture(scope="session", params=["bayes", pytest.param("paper", marks=pytest.mark.soak)])
def edited(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the recording of a run with every kind of edit, by each method."""
    return made_once(tmp_path_factory, f"edited-{request.param}", lambda path: record_edited(path, request.param))
