"""Recordings as pages handle them: named, kept, deleted, downloaded with the token, made into files."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import aiohttp
import pytest

from runtime.console.files.jobs import Jobs
from runtime.console.files.recording_files import RecordingFiles
from tests.runtime.console.console_case import ConsoleCase, open_console

CONTENT = bytes(range(256)) * 600
"""More than two pieces of a download."""


@asynccontextmanager
async def with_files(folder: Path, current: str | None = None) -> AsyncIterator[ConsoleCase]:
    jobs = Jobs(program="tests.runtime.console.files.stub_job")
    (folder / "run.mcap").write_bytes(CONTENT)
    (folder.parent / "secret.mcap").write_bytes(b"elsewhere")
    async with open_console(files=RecordingFiles(folder, lambda: current, jobs)) as case:
        yield case
    await jobs.close()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "runs"
    folder.mkdir()
    return folder


async def get(case: ConsoleCase, path: str, **query: str) -> aiohttp.ClientResponse:
    return await case.session.get(case.url.with_path(path).with_query({"token": case.token, **query}))


async def test_a_recording_is_named_kept_and_deleted(folder: Path) -> None:
    async with with_files(folder) as case:
        page = await case.page()
        assert (await page.ask(type="rename_recording", file="run.mcap", to="dock"))["data"] == "dock.mcap"
        assert (await page.ask(type="pin_recording", file="dock.mcap", pinned=True))["ok"]
        assert "pinned" in (await page.ask(type="delete_recording", file="dock.mcap"))["error"]
        assert (await page.ask(type="pin_recording", file="dock.mcap", pinned=False))["ok"]
        assert (await page.ask(type="delete_recording", file="dock.mcap"))["ok"]
        assert list(folder.glob("*.mcap*")) == []


async def test_the_recording_in_progress_is_neither_deleted_nor_renamed(folder: Path) -> None:
    async with with_files(folder, current=str(folder / "run.mcap")) as case:
        page = await case.page()
        for message in ({"type": "delete_recording", "file": "run.mcap"},
                        {"type": "rename_recording", "file": "run.mcap", "to": "a"}):  # fmt: skip
            assert (await page.ask(**message))["error"] == "run.mcap is being written: stop recording first"
        assert (folder / "run.mcap").read_bytes() == CONTENT


async def test_a_download_is_the_file_and_needs_the_token(folder: Path) -> None:
    async with with_files(folder) as case:
        answer = await get(case, "/recording", file="run.mcap")
        assert (answer.status, await answer.read()) == (200, CONTENT)
        assert answer.headers["Content-Disposition"] == "attachment; filename*=UTF-8''run.mcap"
        assert answer.headers["X-Content-Type-Options"] == "nosniff"
        for token in ("", "wrong"):
            assert (await get(case, "/recording", file="run.mcap", token=token)).status == 403
        for name in ("../secret.mcap", str(folder.parent / "secret.mcap"), "none.mcap", "", ".", "run", "a\0.mcap"):
            answer = await get(case, "/recording", file=name)
            assert (answer.status, "there is no such file" in await answer.text()) == (404, True)


async def test_what_a_job_made_is_announced_and_can_be_had(folder: Path) -> None:
    async with with_files(folder) as case:
        page = await case.page()
        number = (await page.ask(type="make_files", kind="map", file="run.mcap"))["data"]
        while not (job := await page.next("job"))["over"]:
            assert job["job"] == number
        assert job["made"] == ["run.toml", "run.pgm", "run.geojson"]
        answer = await get(case, "/made", job=str(number), file="run.geojson")
        assert (answer.status, await answer.text(), answer.content_type) == (200, "made\n", "application/geo+json")
        for job_name, name in ((str(number), "../run.toml"), ("x", "run.toml"), ("9" * 30, "run.toml"), ("", "")):
            assert (await get(case, "/made", job=job_name, file=name)).status == 404
        assert [job["made"] for job in (await page.ask(type="list_jobs"))["data"]] == [job["made"]]
        assert "nothing to cancel" in (await page.ask(type="cancel_job", job=number))["error"]
        unknown = await page.ask(type="make_files", kind="report", file="../secret.mcap")
        assert "there is no recording" in unknown["error"]


async def test_a_run_without_files_says_so() -> None:
    async with open_console() as case:
        page = await case.page()
        assert "not available" in (await page.ask(type="list_jobs"))["error"]
        assert (await get(case, "/recording", file="run.mcap")).status == 404
