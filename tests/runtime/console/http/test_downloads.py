"""Files that pages download."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.runtime.console.files.files_case import CONTENT, get, with_files


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "runs"
    folder.mkdir()
    return folder


async def test_a_download_is_the_file_and_needs_the_token(folder: Path) -> None:
    async with with_files(folder) as case:
        answer = await get(case, "/recording", file="run.mcap")
        assert (answer.status, await answer.read()) == (200, CONTENT)
        assert answer.headers["Content-Disposition"] == "attachment; filename*=UTF-8''run.mcap"
        assert answer.headers["X-Content-Type-Options"] == "nosniff"
        for token in ("", "wrong"):
            assert (await get(case, "/recording", file="run.mcap", token=token)).status == 403
        for name in ("../secret.mcap", str(folder.parent / "secret.mcap"), "none.mcap", "", ".", "run"):
            answer = await get(case, "/recording", file=name)
            assert (answer.status, "there is no such file" in await answer.text()) == (404, True)
        for name in ("a\0.mcap", "a" * 5000):
            answer = await get(case, "/recording", file=name)
            assert (answer.status, await answer.text()) == (400, "a name that no file can have")
