"""The client against a real console: messages, commands with their challenge, the map, every way to be refused."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import pytest

from behaviors.teleoperation import Teleoperate
from config.errors import WRONG_CALL
from runtime.bridges import console_client
from runtime.bridges.console_client import ConsoleClient, ConsoleError, Message, connect, stay_connected
from runtime.cycle.inputs import Request
from tests.runtime.console.console_case import ConsoleCase, open_console


async def next_of(messages: AsyncIterator[Message], kind: str) -> Message:
    async for message in messages:
        if message["type"] == kind:
            return message
    raise AssertionError(kind)


async def test_a_client_sees_the_run_and_commands_it() -> None:
    async with open_console() as case, connect(case.console.url) as client:
        messages = client.messages()
        session = await next_of(messages, "session")
        assert client.session is session
        assert client.has_control
        assert len(session["ring"]["mounts"]) == 24
        case.cycles(12)
        state = await next_of(messages, "state")
        assert (state["mode"], state["cycle"]) == ("CONNECTING", 12)
        await client.request("arm")
        await client.request("teleoperate", v=0.2, w=0.1)
        assert case.run.asked[-2:] == [Request.ARM, Teleoperate(0.2, 0.1, valid_s=0.25)]


async def test_the_client_keeps_the_whole_map() -> None:
    async with open_console() as case, connect(case.console.url) as client:
        messages = client.messages()
        for _ in range(6):
            case.cycles(4)
            await next_of(messages, "state")
        case.console._publisher.publish()  # segments go with every second frame
        await next_of(messages, "state")
        case.console._publisher.publish()
        await next_of(messages, "state")
        now = case.run.state.perception.segments()
        assert sorted(client.segments) == sorted(now.numbers.tolist()) != []


async def test_a_second_client_watches_asks_for_control_and_gets_it() -> None:
    async with open_console() as case, connect(case.console.url) as first, connect(case.console.url) as second:
        inbox = second.messages()
        await next_of(inbox, "session")
        assert not second.has_control
        with pytest.raises(ConsoleError, match="another client has control"):
            await second.request("arm")
        with pytest.raises(ConsoleError, match="was asked"):
            await second.request("take_control")
        await next_of(first.messages(), "role")
        assert first.asked_by == second.session["client"]
        await first.request("grant_control", client=first.asked_by)
        await next_of(inbox, "role")
        assert second.has_control


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda url: url[:-3] + "xyz", "refuses the token"),
        (lambda url: url.replace("http:", "ftp:"), "no address of a run"),
        (lambda _: "not a url", "no address of a run"),
        (
            lambda _: "http://127.0.0.1:9/?token=x",
            r"no run answers on http://127.0.0.1:9 \(Connection refused\); start",
        ),
    ],
)
async def test_why_a_client_cannot_connect_is_one_line(change: Any, message: str) -> None:
    async with open_console() as case:
        with pytest.raises(ConsoleError, match=message) as caught:
            async with connect(change(case.console.url)):
                pass
        assert "\n" not in str(caught.value)
        assert case.token not in str(caught.value)


async def test_a_wrong_address_is_a_wrong_call() -> None:
    with pytest.raises(ConsoleError) as caught:
        async with connect("8765"):
            pass
    assert caught.value.exit_code == WRONG_CALL


async def test_the_end_of_a_run_ends_the_messages_and_the_commands() -> None:
    async with open_console() as case, connect(case.console.url) as client:
        messages = client.messages()
        await next_of(messages, "session")
        assert case.console._server is not None
        await case.console._server.close()
        with pytest.raises(ConsoleError, match="the run is over"):
            await next_of(messages, "never")
        with pytest.raises(ConsoleError, match="the run is over"):
            await client.request("arm")


async def test_states_that_are_not_taken_are_dropped_and_lines_of_the_log_are_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(console_client, "KEPT_MAX", 4)
    client = ConsoleClient(None)  # type: ignore[arg-type]
    segments: Message = {"whole": False, "removed": [], "added": []}
    for number in range(9):
        client._take({"type": "state", "controller": True, "segments": segments, "number": number})
        client._take({"type": "log", "number": number} if number < 3 else {"type": "answer", "id": 1, "ok": True})
    kept = [(message["type"], message["number"]) for message in client._kept]
    assert kept == [("log", 0), ("log", 1), ("log", 2), ("state", 8)]
    assert client.dropped == 8


async def test_polylines_are_kept_until_a_state_has_others() -> None:
    client = ConsoleClient(None)  # type: ignore[arg-type]
    segments: Message = {"whole": False, "removed": [], "added": []}
    changes: list[Message] = [{}, {"polylines": [{"number": 3}]}, {}, {"polylines": []}]
    known = []
    for change in changes:
        client._take({"type": "state", "controller": True, "segments": segments, **change})
        known.append([one["number"] for one in client.polylines])
    assert known == [[], [3], [3], []]


async def test_it_connects_again_and_reports_each_problem_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console_client, "RETRY_FIRST_S", 0.001)
    lines: list[str] = []
    served: list[int] = []
    found: list[str] = ["http://127.0.0.1:9/?token=x"] * 3

    async with open_console() as case:

        async def serve(client: ConsoleClient) -> None:
            await next_of(client.messages(), "session")
            served.append(1)

        task = asyncio.create_task(
            stay_connected(lambda: found.pop() if found else case.console.url, serve, lines.append)
        )
        await case.settled(lambda: len(served) >= 2, "two connections")
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
    assert len(lines) == 1
    assert "no run answers" in lines[0]


async def test_a_robot_moves_no_more_once_its_client_has_gone() -> None:
    async def drive(case: ConsoleCase) -> None:
        async with connect(case.console.url) as client:
            await next_of(client.messages(), "session")
            await client.request("teleoperate", v=0.2, w=0.0)

    async with open_console() as case:
        await drive(case)
        await case.settled(lambda: case.run.asked[-1:] == [Teleoperate(0.0, 0.0)], "the end of teleoperation")
