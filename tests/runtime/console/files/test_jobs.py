"""Jobs on recordings: progress, files, errors, cancelling; one at a time, and nothing outlives the console."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from runtime.console.commands.command_error import CommandError
from runtime.console.files.jobs import KEPT, Jobs
from runtime.console.sent_messages import JobMessage
from tests.hil.machine import TIMEOUT_S

PROGRAM = "tests.runtime.console.files.stub_job"


@asynccontextmanager
async def jobs_of() -> AsyncIterator[tuple[Jobs, list[JobMessage]]]:
    jobs, sent = Jobs(program=PROGRAM), list[JobMessage]()
    jobs.broadcast = sent.append
    try:
        yield jobs, sent
    finally:
        await jobs.close()


async def over(sent: list[JobMessage], number: int) -> JobMessage:
    async with asyncio.timeout(TIMEOUT_S):
        while not any(one["over"] for one in sent if one["job"] == number):
            await asyncio.sleep(0.005)
    return next(one for one in sent if one["over"] and one["job"] == number)


async def test_a_job_says_how_far_it_is_and_what_it_made(tmp_path: Path) -> None:
    async with jobs_of() as (jobs, sent):
        number = jobs.start("map", "run.mcap", tmp_path / "run.mcap")
        with pytest.raises(CommandError, match=r"a map of run\.mcap is being made: wait for it, or cancel it"):
            jobs.start("report", "run.mcap", tmp_path / "run.mcap")
        done = await over(sent, number)
        assert [(one["share"], one["what"]) for one in sent[:-1]] == [(0.25, "reading"), (0.5, "drawing the map")]
        assert (done["made"], done["error"]) == (["run.toml", "run.pgm", "run.geojson"], None)
        assert jobs.listed() == [done]
        made = jobs.path_of(number, "run.toml")
        assert made is not None
        assert made.read_text() == "made\n"
        for job, name in ((number, "../1/run.toml"), (number, "run.yaml"), (99, "run.toml"), (number, "")):
            assert jobs.path_of(job, name) is None
    assert not made.exists(), "they go with the console"


async def test_a_job_that_fails_says_why(tmp_path: Path) -> None:
    async with jobs_of() as (jobs, sent):
        done = await over(sent, jobs.start("report", "broken.mcap", tmp_path / "broken.mcap"))
        assert (done["error"], done["made"], done["what"]) == ("broken.mcap: holds no cycle", [], "failed")


async def test_a_job_is_cancelled_and_another_can_begin(tmp_path: Path) -> None:
    async with jobs_of() as (jobs, sent):
        number = jobs.start("map", "endless.mcap", tmp_path / "endless.mcap")
        async with asyncio.timeout(TIMEOUT_S):
            while not sent:
                await asyncio.sleep(0.005)
        jobs.cancel(number)
        assert (await over(sent, number))["error"] == "cancelled"
        with pytest.raises(CommandError, match="nothing to cancel"):
            jobs.cancel(number)
        assert (await over(sent, jobs.start("report", "a.mcap", tmp_path / "a.mcap")))["made"] == ["a.html"]
        jobs.start("map", "endless.mcap", tmp_path / "endless.mcap")  # ends with the console


async def test_a_job_that_is_cancelled_before_it_began_is_over(tmp_path: Path) -> None:
    async with jobs_of() as (jobs, sent):
        number = jobs.start("map", "run.mcap", tmp_path / "run.mcap")
        jobs.cancel(number)
        assert (await over(sent, number))["error"] == "cancelled"
        assert (await over(sent, jobs.start("report", "a.mcap", tmp_path / "a.mcap")))["made"] == ["a.html"]


async def test_a_job_whose_process_cannot_be_understood_has_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def endless_line(*_: object) -> str:
        raise ValueError("Separator is not found, and chunk exceed the limit")

    monkeypatch.setattr(Jobs, "_follow", endless_line)
    async with jobs_of() as (jobs, sent):
        done = await over(sent, jobs.start("map", "run.mcap", tmp_path / "run.mcap"))
        assert (done["what"], done["made"]) == ("failed", [])
        assert "cannot be read" in str(done["error"])


async def test_files_of_old_jobs_are_deleted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("runtime.console.files.jobs.KEPT", 1)
    assert KEPT == 8
    async with jobs_of() as (jobs, sent):
        first = jobs.start("report", "a.mcap", tmp_path / "a.mcap")
        await over(sent, first)
        made = jobs.path_of(first, "a.html")
        assert made is not None
        second = jobs.start("report", "b.mcap", tmp_path / "b.mcap")
        await over(sent, second)
        assert (made.exists(), jobs.path_of(first, "a.html")) == (False, None)
