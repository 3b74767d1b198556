"""A run of the command with an emulated base, for pages that operate it."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from pathlib import Path

from tests.browser.open_page import Opener
from tests.hil.running import Running, running, start_url
from tests.hil.truth import Row, Truth


@dataclass
class Run:
    """A running process, the address of its page, and the true state of its base."""

    command: Running
    url: str
    truth: Truth
    recording: Path

    async def sees(self, done: Callable[[Row], bool], what: str) -> Row:
        """Wait until the true state of the base fulfils a condition."""
        return await asyncio.to_thread(self.truth.wait, done, what)


@contextlib.asynccontextmanager
async def run(folder: Path, opener: Opener) -> AsyncIterator[Run]:
    """Start a run in a folder, and close all pages before it ends."""
    trace, recording = folder / "trace.csv", folder / "run.mcap"
    more = [
        "--set",
        "console.port=0",
        "--set",
        "console.command_age_max_s=60.0",
        "--trace",
        str(trace),
        "--record",
        str(recording),
    ]
    with running(folder, "run", "run", *more) as command:
        url = await asyncio.to_thread(start_url, command)
        try:
            yield Run(command, url, Truth(trace), recording)
        finally:
            await opener.leave()  # before the server goes: no page reports that
