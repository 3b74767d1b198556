"""Recordings as pages handle them: named, kept, deleted, made into files."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from tests.runtime.console.console_case import open_console
from tests.runtime.console.files.files_case import get, with_files


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "runs"
    folder.mkdir()
    return folder


async def test_a_recording_is_named_kept_and_deleted(folder: Path) -> None:
    async with with_files(folder) as case:
        page = await case.page()
        assert (await page.ask(type="rename_recording", file="run.mcap", to="dock"))["data"] == "dock.mcap"
        assert (await page.ask(type="pin_recording", file="dock.mcap", pinned=True))["ok"]
        assert "pinned" in (await page.ask(type="delete_recording", file="dock.mcap"))["error"]
        assert (await page.ask(type="pin_recording", file="dock.mcap", pinned=False))["ok"]
        assert (await page.ask(type="delete_recording", file="dock.mcap"))["ok"]
        assert list(folder.glob("*.mcap*")) == []


@pytest.mark.parametrize("seed", range(3))
async def test_each_undo_leaves_names_and_pins_as_they_were(folder: Path, seed: int) -> None:
    """Over random new names and pins, some of which change nothing or are refused."""
    rng, done, changes = random.Random(seed), list[list[str]](), 0

    def held() -> list[str]:
        return sorted(path.name for path in folder.iterdir())

    async with with_files(folder) as case:
        page = await case.page()
        (folder / "other.mcap").write_bytes(b"x")
        begin = held()

        async def take_back() -> None:
            assert (await page.ask(type="undo_file"))["data"].endswith(" again")
            assert held() == done.pop()

        for _ in range(40):
            before, file = held(), rng.choice(["run", "other", "dock", "gone"]) + ".mcap"
            if done and rng.random() < 0.3:
                await take_back()
                continue
            if rng.random() < 0.5:
                await page.ask(type="rename_recording", file=file, to=rng.choice(["dock", "run", "../x"]))
            else:
                await page.ask(type="pin_recording", file=file, pinned=rng.random() < 0.6)
            if held() != before:
                changes += 1
                done.append(before)
        while done:
            await take_back()
        assert held() == begin
        assert changes >= 3
        assert "no new name or pin" in (await page.ask(type="undo_file"))["error"]


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
