"""A run of the command with an emulated base, for pages that operate it."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tests.browser.open_page import Opener
from tests.hil.running import PATIENT, Running, running, start_url, wait_for
from tests.hil.truth import Row, Truth

STARTS: Final = 4
"""On a busy machine the emulated robot may not answer in time: the run ends, as it must, and is started again."""


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
    with contextlib.ExitStack() as stack:
        for start in range(STARTS):
            trace, recording = folder / f"trace{start}.csv", folder / f"run{start}.mcap"
            more = [
                *("--set", "console.port=0", "--set", "console.command_age_max_s=60.0", *PATIENT),
                *("--trace", str(trace), "--record", str(recording)),
            ]
            command = stack.enter_context(running(folder, f"run{start}", "run", *more))
            if await asyncio.to_thread(has_robot, command):
                break
        else:
            raise AssertionError(command.err)
        url = await asyncio.to_thread(start_url, command)
        try:
            yield Run(command, url, Truth(trace), recording)
        except Exception as error:
            if command.process.poll() is not None:
                raise AssertionError(f"the run has ended before its page: {command.err}") from error
            raise
        finally:
            await opener.leave()  # before the server goes: no page reports that


def has_robot(command: Running) -> bool:
    """Wait until the robot of a run has answered; return False if the run has ended for want of an answer."""

    def is_decided() -> bool:
        found = {event["event"] for event in command.events()}
        return "robot ready" in found or command.process.poll() is not None

    wait_for(is_decided, "a robot", lambda: command.err)
    return command.process.poll() is None
