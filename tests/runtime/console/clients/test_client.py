"""A client gets the newest frame only, its queue is bounded, and it delays no other client."""

from __future__ import annotations

import asyncio

import orjson
import pytest

from runtime.console.clients.client import Client
from runtime.console.http.client_limits import Limits
from tests.rawpage import RawPage
from tests.runtime.console.console_case import ConsoleCase, open_console


class SlowTransport:
    """Accepts a number of messages and then blocks."""

    def __init__(self, takes: int = 0) -> None:
        self.takes = takes
        self.sent: list[bytes] = []
        self.aborted = False
        self.more = asyncio.Event()

    async def send(self, data: bytes) -> None:
        while len(self.sent) >= self.takes:
            self.more.clear()
            await self.more.wait()
        self.sent.append(data)

    def abort(self) -> None:
        self.aborted = True


async def test_a_slow_client_skips_frames_and_gets_the_newest_with_all_segments() -> None:
    async with open_console() as case:
        case.cycles()
        transport = SlowTransport(2)
        client = case.console.hub.join(transport, "slow", case.console._session(), has_token=False)
        sender = asyncio.create_task(client.send_all())
        quick = await case.page()
        for _ in range(30):
            case.cycles()
            await quick.next("state")
        assert len(transport.sent) == 2, "session information and a frame"
        transport.takes = 4
        transport.more.set()
        await case.settled(lambda: len(transport.sent) == 4, "two more frames")
        behind, newest = orjson.loads(transport.sent[2]), orjson.loads(transport.sent[3])
        assert behind["cycle"] == 3, "was in flight"
        assert newest["cycle"] == 31
        assert newest["dropped"] == 27
        assert newest["segments"]["whole"]
        case.console.hub.leave(client)
        client.leave()
        await sender


async def test_a_client_that_never_reads_holds_one_frame_and_is_disconnected() -> None:
    limits = Limits(stall_s=10.0)
    async with open_console(limits=limits) as case:
        silent = await asyncio.to_thread(RawPage, case.console.url, receive_bytes=4096)
        client, page = case.console.hub.clients[1], await case.page()
        held: list[int] = []
        while client._sending_since_s is None:
            assert len(held) < 2000, "it accepts everything, so nothing was tested"
            case.cycles()
            assert (await page.next("state"))["cycle"] == len(held) + 1
            held.append(buffered(case))
        for _ in range(150):
            case.cycles()
            await page.next("state")
            held.append(buffered(case))
        assert client.number in case.console.hub.clients
        assert max(held) < 32_768, "only one frame is buffered"
        case.cycles(step_s=300.0)
        await case.settled(lambda: 1 not in case.console.hub.clients, "its disconnection")
        assert any("it accepted no data for 10 s" in why for why in case.refusals())
        silent.close()


def buffered(case: ConsoleCase) -> int:
    """Return the bytes buffered for the client that has most."""
    assert case.console._server is not None
    websockets = case.console._server._websockets.values()
    return max(websocket._writer.transport.get_write_buffer_size() for websocket in websockets)  # type: ignore[union-attr]


async def test_the_queue_of_a_client_is_bounded() -> None:
    transport = SlowTransport()
    client = Client(1, "silent", transport, Limits(queue_messages=10), lambda: 0.0, has_token=True)
    for _ in range(10):
        assert not client.is_gone
        client.send({"type": "answer"})
    client.send({"type": "answer"})
    assert transport.aborted
    assert client.is_gone
    client.send({"type": "answer"})
    another = Client(
        2,
        "silent",
        transport := SlowTransport(),
        Limits(queue_messages=1000, queue_bytes=1000),
        lambda: 0.0,
        has_token=True,
    )
    for _ in range(200):
        another.send_if_room(b"x" * 10)
    another.send_encoded(b"x" * 1000)
    assert transport.aborted


@pytest.mark.parametrize("name", ["console sender 1", "console client 1"])
async def test_a_failed_task_of_a_client_is_reported_and_disconnects_it(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with open_console() as case:
        page = await case.page()
        if name == "console client 1":
            monkeypatch.setattr(case.console.dispatcher, "_run", lambda *_: 1 / 0)
            await page.send(type="halt")
        else:
            (task,) = [task for task in asyncio.all_tasks() if task.get_name() == name]
            task.cancel()
        await case.settled(lambda: not case.console.hub.clients, "its disconnection")
        fault = case.run.health.fault()
        assert fault is not None
        assert name in fault
        assert case.run.health.fault() is None, "the fault is over"
        await case.page()
