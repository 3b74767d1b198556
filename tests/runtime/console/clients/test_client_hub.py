"""Messages to all clients: session information and lines of the log."""

from __future__ import annotations

import asyncio
from typing import Any

import orjson
import pytest

from runtime.console.http.client_limits import LOG_LINES_BURST, Limits
from tests.runtime.console.clients.test_client import SlowTransport
from tests.runtime.console.console_case import ConsoleCase, open_console


async def test_a_client_that_joins_before_the_robot_answers_gets_its_name_later() -> None:
    async with open_console() as case:
        case.run.name = None
        page = await case.page()
        assert page.received[0]["name"] is None
        case.run.name = "denning"
        case.cycles()
        assert (await page.next("session"))["name"] == "denning"


async def test_log_lines_also_reach_later_clients() -> None:
    async with open_console() as case:
        page = await case.page()
        case.console.hub.on_log({"event": "mode", "level": "info", "timestamp": "now", "mode": "READY", "cycle": 3})
        line = await page.next("log")
        assert line == {"type": "log", "timestamp": "now", "level": "info", "event": "mode",
                        "fields": {"mode": "READY", "cycle": "3"}}  # fmt: skip
        later = await case.connect()
        assert await later.next("log") == line
        await asyncio.to_thread(case.console.hub.on_log, {"event": "from a thread", "changed": ["a", "b"]})
        line = await page.next("log")
        assert (line["event"], line["fields"]) == ("from a thread", {"changed": "a, b"})


class Slow:
    """A client that reads nothing, joined without a socket."""

    def __init__(self, case: ConsoleCase) -> None:
        self.transport = SlowTransport()
        self.client = case.console.hub.join(self.transport, "slow", case.console._session(), has_token=True)

    @property
    def queued(self) -> list[dict[str, Any]]:
        return [orjson.loads(data) for data in self.client._queue]


@pytest.mark.promise("P22")
async def test_requests_for_control_do_not_fill_the_queue_of_the_holder() -> None:
    """Others can ask as often as they like; a holder that is slow for a moment stays, and gets one request."""
    async with open_console() as case:
        holder, first, second = (Slow(case) for _ in range(3))
        for k in range(600):
            case.console.dispatcher.receive((first, second)[k % 2].client, '{"id":1,"type":"take_control"}')
            first.client._queue.clear()
            second.client._queue.clear()
        assert not holder.client.is_gone
        roles = [message for message in holder.queued if message["type"] == "role"]
        assert [message["client"] for message in roles] == [first.client.number]
        assert holder.client._queue_bytes == sum(map(len, holder.client._queue))
        for one in (holder, first, second):
            case.console.hub.leave(one.client)


@pytest.mark.promise("P22")
async def test_changes_of_parameters_do_not_fill_the_queues_of_others() -> None:
    """Nor the log."""
    async with open_console(limits=Limits(queue_messages=1000)) as case:
        tuner, watcher = Slow(case), Slow(case)
        path = "behaviors.teleoperation.message_age_max_s"
        for k in range(60):
            text = f'{{"id":1,"type":"set_parameter","path":"{path}","value":{0.1 + 0.1 * (k % 2)},"challenge":%d}}'
            case.console.dispatcher.receive(tuner.client, text % case.console.hub.challenges.issue())
        assert not watcher.client.is_gone
        assert not tuner.client.is_gone
        sent = [message for message in watcher.queued if message["type"] == "parameters"]
        assert len(sent) == 1
        values = {one["path"]: one["value"] for one in sent[0]["parameters"]}
        assert values[path] == pytest.approx(0.2)
        lines = [line for line in case.log if line["event"] == "configuration changed from the console"]
        assert len(lines) == LOG_LINES_BURST
        for one in (tuner, watcher):
            case.console.hub.leave(one.client)


async def test_a_client_that_watches_a_recording_gets_the_state_of_the_robot_itself() -> None:
    async with open_console() as case:
        live, viewer = await case.page(), await case.page()
        next(reversed(case.console.hub.clients.values())).switch(live=False)
        case.cycles()
        status = await viewer.next("robot", "state")
        assert status["type"] == "robot"
        assert (status["mode"], status["clients"], status["paused"]) == ("CONNECTING", 2, False)
        assert (await live.next("robot", "state"))["type"] == "state"
