"""A console whose run keeps its recordings in a folder."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import aiohttp

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


async def get(case: ConsoleCase, path: str, **query: str) -> aiohttp.ClientResponse:
    return await case.session.get(case.url.with_path(path).with_query({"token": case.token, **query}))
