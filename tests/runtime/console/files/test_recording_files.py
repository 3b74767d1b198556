"""The recordings of a run's folder, of which one may be in progress."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.runtime.console.files.files_case import CONTENT, with_files


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "runs"
    folder.mkdir()
    return folder


async def test_the_recording_in_progress_is_neither_deleted_nor_renamed(folder: Path) -> None:
    async with with_files(folder, current=str(folder / "run.mcap")) as case:
        page = await case.page()
        for message in ({"type": "delete_recording", "file": "run.mcap"},
                        {"type": "rename_recording", "file": "run.mcap", "to": "a"}):  # fmt: skip
            assert (await page.ask(**message))["error"] == "run.mcap is being written: stop recording first"
        assert (folder / "run.mcap").read_bytes() == CONTENT
