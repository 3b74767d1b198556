"""Commands that take time (time control, recording, replay) are answered when they are done."""

from __future__ import annotations

import asyncio
from typing import Any, cast

import pytest

from config.errors import UserError
from runtime.console.commands.command_error import CommandError
from runtime.console.frames.frame_encoder import RecordingStatus
from runtime.console.protocols import Viewer
from runtime.console.sent_messages import ListedRecording, OpenedRecording
from tests.runtime.console.console_case import open_console
from tests.runtime.console.sample_messages import ASYNC_COMMANDS


class StubControl:
    """Stub of time control, recording and replay that notes what it is asked for."""

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.refusal: str | None = None
        self.release = asyncio.Event()
        self.release.set()
        self.left: list[Viewer] = []
        self.is_paused = True
        self.speed = 2.0
        self.now = RecordingStatus("run.mcap", 10, 0)

    async def _do(self, what: str) -> str | None:
        await self.release.wait()
        self.calls.append(what)
        return self.refusal

    async def _show(self, what: str) -> None:
        refusal = await self._do(what)
        if refusal is not None:
            raise CommandError(refusal)

    async def pause(self) -> str | None:
        return await self._do("pause")

    async def resume(self) -> str | None:
        return await self._do("resume")

    async def single_step(self) -> str | None:
        return await self._do("single_step")

    async def set_speed(self, factor: float) -> str | None:
        return await self._do(f"speed {factor}")

    async def record(self, *, on: bool) -> str | None:
        return await self._do(f"record {on}")

    async def bookmark(self, text: str) -> str | None:
        return await self._do(f"bookmark {text}")

    async def undo_bookmark(self) -> str:
        await self._show("undo_bookmark")
        return "here"

    async def recordings(self) -> list[ListedRecording]:
        await self._show("recordings")
        return [cast("ListedRecording", {"file": "run.mcap"})]

    async def open(self, viewer: Viewer, file: str) -> OpenedRecording:
        await self._show(f"open {file}")
        viewer.switch(live=False)
        return cast("OpenedRecording", {"seconds": 3.0})

    async def seek(self, _viewer: Viewer, s: float) -> None:
        await self._show(f"seek {s}")

    async def play(self, _viewer: Viewer, speed: float) -> None:
        await self._show(f"play {speed}")

    async def step(self, _viewer: Viewer, cycles: int) -> None:
        await self._show(f"step {cycles}")

    def show_grid(self, _viewer: Viewer) -> None:
        self.calls.append("grid")

    async def close_recording(self, viewer: Viewer) -> None:
        await self._show("close_recording")
        viewer.switch(live=True)

    def leave(self, viewer: Viewer) -> None:
        self.left.append(viewer)

    async def close(self) -> None:
        self.calls.append("close")


@pytest.mark.parametrize(("message", "done"), ASYNC_COMMANDS, ids=lambda value: str(value)[:30])
async def test_an_async_command_is_answered_when_it_is_done(message: dict[str, Any], done: str) -> None:
    stub = StubControl()
    async with open_console(time=stub, recording=stub, replay=stub) as case:
        page = await case.page()
        assert (await page.ask(**message))["ok"]
        assert stub.calls == [done]
        stub.refusal = "not just now"
        assert (await page.ask(**message))["error"] == "not just now"
        stub.refusal = None
        stub.release.clear()
        slow = await page.send(**message)
        assert "still running" in (await page.ask(**message))["error"]
        assert (await page.ask(type="halt"))["ok"], "HALT does not wait for it"
        stub.release.set()
        assert (await page.answer(slow))["ok"]
    async with open_console() as case:
        page = await case.page()
        assert (await page.ask(**message))["error"] == f"{message['type']}: not available in this run"


async def test_any_error_that_says_what_to_do_is_an_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    async def full() -> str:
        raise UserError("the disk is full: delete recordings")

    stub = StubControl()
    monkeypatch.setattr(stub, "undo_bookmark", full)
    async with open_console(recording=stub) as case:
        page = await case.page()
        answer = await page.ask(type="undo_bookmark")
        assert (answer["error"], answer["field"]) == ("the disk is full: delete recordings", None)
        assert case.run.health.fault() is None


async def test_a_client_that_leaves_ends_its_command() -> None:
    stub = StubControl()
    async with open_console(time=stub, recording=stub, replay=stub) as case:
        page = await case.page()
        stub.release.clear()
        await page.send(type="open_recording", file="run.mcap")
        await case.settled(lambda: bool(case.console._tasks), "the task")
        await page.socket.close()
        await case.settled(lambda: not case.console._tasks, "the end of the task")
        assert len(stub.left) == 1


async def test_an_unexpected_error_is_a_fault_of_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    stub = StubControl()
    monkeypatch.setattr(stub, "_do", lambda _what: 1 / 0)
    async with open_console(time=stub, recording=stub, replay=stub) as case:
        page = await case.page()
        await page.send(type="pause")
        await case.settled(lambda: any(line["event"] == "a part failed" for line in case.log), "a line in the log")
        assert "console command 1" in str(case.run.health.fault())


async def test_a_recording_is_shown_only_to_the_client_that_opened_it() -> None:
    stub = StubControl()
    async with open_console(time=stub, recording=stub, replay=stub) as case:
        page, other = await case.page(), await case.page()
        assert (await page.ask(type="open_recording", file="run.mcap"))["data"] == {"seconds": 3.0}
        case.cycles()
        frame = await other.next("state")
        assert (frame["paused"], frame["speed"]) == (True, 2.0)
        assert frame["recording"] == {"file": "run.mcap", "bytes": 10, "dropped": 0}
        assert not [message for message in page.received if message["type"] == "state"]
        await page.ask(type="close_recording")
        case.cycles()
        assert (await page.next("state"))["segments"]["whole"]
    assert stub.calls[-1] == "close"
