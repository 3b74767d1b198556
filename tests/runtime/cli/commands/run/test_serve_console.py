"""Tests of serving the console of a run: the page is served while the run lasts, and replays end with it."""

from __future__ import annotations

from pathlib import Path

import aiohttp
import pytest
import structlog

from config.load import load_settings
from runtime.cli.commands.run.run_recording import open_run_recording
from runtime.cli.commands.run.serve_console import REPLAY_PROGRAM, serve_console
from runtime.console.playback.replay_client import ReplayClient
from runtime.support.kernel_loader import KernelLoader
from runtime.support.restart import Restart
from runtime.timing.time_control import NoTimeControl
from tests.runtime.console.console_case import StubRun


def _drop(*_: object) -> dict[str, object]:
    raise structlog.DropEvent


async def test_the_page_is_served_while_the_run_lasts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = load_settings(
        "hallway", ["perception.method=paper", "console.port=0", f"recording.folder='{tmp_path}'"]
    )
    log = structlog.wrap_logger(None, processors=[_drop])
    closed: list[ReplayClient] = []
    close = ReplayClient.close

    async def noted(self: ReplayClient) -> None:
        closed.append(self)
        await close(self)

    monkeypatch.setattr(ReplayClient, "close", noted)
    async with aiohttp.ClientSession() as session:
        with open_run_recording(settings, None, no_record=True, emulated=False) as recording:
            async with serve_console(
                StubRun(settings, log),
                log,
                KernelLoader(log),
                recording,
                NoTimeControl(),
                emulated=False,
                units="m",
                reload=lambda: settings,
                restart=Restart(None),
            ) as console:
                async with session.get(console.url) as answer:
                    assert answer.status == 200
                    assert "text/html" in answer.headers["Content-Type"]
                assert closed == []
            with pytest.raises(aiohttp.ClientError):
                await session.get(console.url)
    assert closed


def test_the_program_that_replays_a_recording_exists() -> None:
    assert (Path(__file__).parents[5] / f"{REPLAY_PROGRAM.replace('.', '/')}.py").is_file()
