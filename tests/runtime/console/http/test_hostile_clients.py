"""A client with the token that floods, never reads, or sends what is not a message: answered or dropped, and bounded.

What it costs the run is counted: messages in a turn of the loop, and bytes kept. The HALT of another client is
carried out in the turns in which it arrives.
"""

from __future__ import annotations

import asyncio
import base64
import contextlib
import os
import struct
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import orjson
import pytest
from aiohttp import WSServerHandshakeError

from runtime.console.clients.client import Client
from runtime.console.http.client_limits import LOG_LINES_BURST, Limits
from runtime.console.http.server import JOINS_BURST
from runtime.cycle.inputs import Request
from tests.runtime.console.clients.test_client import SlowTransport
from tests.runtime.console.console_case import TIMEOUT_S, ConsoleCase, open_console

pytestmark = pytest.mark.promise("P22")

BOUNDLESS = Limits(messages_per_s=1e9, bytes_burst=1e12)
"""So that the bounds on a turn of the loop show alone."""
TEXT, PING, PONG, CONTINUATION = 0x1, 0x9, 0xA, 0x0
TURNS_MAX = 6
"""Turns of the loop from sending a message until it is carried out: select, wake the task, and some spare."""


@dataclass
class RawPage:
    """A websocket whose every frame the test writes."""

    reader: asyncio.StreamReader
    writer: asyncio.StreamWriter

    def write(self, opcode: int, payload: bytes = b"", *, fin: bool = True, count: int = 1) -> None:
        """Write a frame, masked with zeros, so many times."""
        first = bytes([opcode | (0x80 if fin else 0)])
        size = bytes([0x80 | len(payload)]) if len(payload) < 126 else b"\xfe" + struct.pack(">H", len(payload))
        self.writer.write((first + size + bytes(4) + payload) * count)

    async def rest(self) -> bytes:
        """Return what the server sends until it drops the connection."""
        received = bytearray()
        with contextlib.suppress(ConnectionError):
            while data := await asyncio.wait_for(self.reader.read(65_536), TIMEOUT_S):
                received += data
        return bytes(received)


@contextlib.asynccontextmanager
async def raw_page(case: ConsoleCase) -> AsyncIterator[RawPage]:
    """Connect a websocket by hand."""
    reader, writer = await asyncio.open_connection("127.0.0.1", case.url.port)
    lines = [
        f"GET /ws?token={case.token} HTTP/1.1", f"Host: 127.0.0.1:{case.url.port}", f"Origin: {case.origin}",
        "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13",
        f"Sec-WebSocket-Key: {base64.b64encode(os.urandom(16)).decode()}", "", "",
    ]  # fmt: skip
    writer.write("\r\n".join(lines).encode())
    assert (await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), TIMEOUT_S)).startswith(b"HTTP/1.1 101")
    try:
        yield RawPage(reader, writer)
    finally:
        writer.transport.abort()
        with contextlib.suppress(ConnectionError):
            await writer.wait_closed()


@dataclass
class Turns:
    """Counts the loop's turns, and in each the messages that were carried out."""

    case: ConsoleCase
    turn: int = 0
    messages: list[tuple[int, str]] = field(default_factory=list)
    """The turn and the text of each."""

    def __post_init__(self) -> None:
        receive = self.case.console._server._context.on_message  # type: ignore[union-attr]

        def counted(client: Client, text: str) -> None:
            self.messages.append((self.turn, text))
            receive(client, text)

        object.__setattr__(self.case.console._server._context, "on_message", counted)  # type: ignore[union-attr]
        self._next()

    def _next(self) -> None:
        self.turn += 1
        self._handle = asyncio.get_running_loop().call_soon(self._next)

    def stop(self) -> None:
        """Count no more."""
        self._handle.cancel()

    def have_been(self, count: int) -> bool:
        """Return whether more messages than these have been carried out."""
        return len(self.messages) > count

    def most(self) -> int:
        """Return the most messages in one turn, HALT not counted."""
        counts: dict[int, int] = {}
        for turn, text in self.messages:
            if '"halt"' not in text:
                counts[turn] = counts.get(turn, 0) + 1
        return max(counts.values())


def is_longer(kept: list[object], count: int) -> bool:
    """Return whether a list holds more than this."""
    return len(kept) > count


SMALL = b'{"id":1,"type":"evidence","object":1}'
COMMANDS = 100_000


async def test_a_hundred_thousand_commands_of_one_client(measured: Callable[[str], None]) -> None:
    """As many as it may send in a second are carried out, one in a turn; then it gets the reason and is dropped."""
    async with open_console() as case:
        turns, other = Turns(case), await case.page()
        async with raw_page(case) as page:
            page.write(TEXT, SMALL, count=COMMANDS)
            rest = await page.rest()
        turns.stop()
        assert b"too many messages" in rest or len(turns.messages) < COMMANDS
        assert len(turns.messages) <= Limits().messages_per_s
        assert turns.most() == 1
        assert (await other.ask(type="halt"))["ok"]
        assert case.run.asked == [Request.HALT]
        assert any("200 messages a second" in why or "bytes a second" in why for why in case.refusals())
        measured(f"{COMMANDS:,} commands at once: {len(turns.messages)} carried out, {turns.most()} in a turn")


async def test_halt_passes_the_floods_of_all_other_clients(measured: Callable[[str], None]) -> None:
    """With no bound on rates: one message of all clients in a turn, and a HALT in the turns in which it arrives."""
    count = 1000
    async with open_console(limits=BOUNDLESS) as case, contextlib.AsyncExitStack() as stack:
        turns, operator = Turns(case), await case.page()
        floods = [await stack.enter_async_context(raw_page(case)) for _ in range(8)]
        took = []
        for flood in floods:
            flood.write(TEXT, SMALL, count=count)
        for k in range(5):
            await case.settled(partial(turns.have_been, 20 * (k + 1)), "the flood")
            sent_in = turns.turn
            await operator.socket.send_str('{"id":1,"type":"halt"}')
            await case.settled(partial(is_longer, case.run.asked, k), "the HALT")
            took.append(next(turn for turn, text in turns.messages[::-1] if '"halt"' in text) - sent_in)
        turns.stop()
        assert len(turns.messages) < 8 * count, "the floods were not over yet"
        assert turns.most() == 1
        assert max(took) <= TURNS_MAX
        measured(f"HALT amid the floods of {len(floods)} clients: carried out {max(took)} turns of the loop later")


async def test_a_flood_of_halts_keeps_no_other_halt_waiting() -> None:
    async with open_console(limits=BOUNDLESS) as case, raw_page(case) as flood:
        turns, operator = Turns(case), await case.page()
        flood.write(TEXT, b'{"id":1,"type":"halt"}', count=1000)
        await case.settled(lambda: len(turns.messages) > 20, "the flood")
        sent_in = turns.turn
        await operator.socket.send_str('{"id":7,"type":"halt"}')
        await case.settled(lambda: any('"id":7' in text for _, text in turns.messages), "the HALT")
        turns.stop()
        assert next(turn for turn, text in turns.messages if '"id":7' in text) - sent_in <= TURNS_MAX
        of_flood = [turn for turn, text in turns.messages if '"id":1' in text]
        assert len(of_flood) == len(set(of_flood)), "one in a turn"


async def test_messages_take_a_bounded_share_of_the_loop() -> None:
    """After a message that took 10 ms the clients' messages rest for 40 ms; HALT does not."""
    async with open_console() as case:
        rests: list[float] = []
        sleep, server = asyncio.sleep, case.console._server
        assert server is not None
        receive = server._context.on_message

        def slow(client: Client, text: str) -> None:
            case.clock[0] += 0.010 if '"halt"' not in text else 1.0
            receive(client, text)

        object.__setattr__(server._context, "on_message", slow)
        page = await case.page()

        async def noted(rest_s: float) -> None:
            rests.append(rest_s)
            await sleep(0.0)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("runtime.console.http.server.asyncio.sleep", noted)
            for _ in range(3):
                await page.ask(type="evidence", object=1)
            await page.ask(type="halt")
        assert rests[:3] == pytest.approx([0.040] * 3)
        assert rests[3] == 0.0


async def test_pings_count_as_messages(measured: Callable[[str], None]) -> None:
    async with open_console() as case, raw_page(case) as page:
        page.write(PING, b"0123456789", count=5000)
        rest = await page.rest()
        assert 1 <= rest.count(b"\x8a\x0a0123456789") <= Limits().messages_per_s
        assert any("messages a second" in why for why in case.refusals())
        assert (await (await case.page()).ask(type="halt"))["ok"]
        measured(f"5,000 pings: at most {Limits().messages_per_s:g} answered, then dropped")


async def test_unasked_pongs_count_as_messages() -> None:
    async with open_console() as case, raw_page(case) as page:
        page.write(PONG, count=2000)
        await page.rest()
        assert any("messages a second" in why for why in case.refusals())


@pytest.mark.parametrize("piece", [b"", b" "])
async def test_endless_fragments_are_dropped(piece: bytes, measured: Callable[[str], None]) -> None:
    """A message that never ends, in fragments of a byte or none."""
    frame_bytes = 6 + len(piece)
    async with open_console() as case, raw_page(case) as page:
        page.write(TEXT, b"{", fin=False)
        sent = 0
        with contextlib.suppress(ConnectionError):
            while not page.writer.is_closing() and sent < 10_000_000:
                page.write(CONTINUATION, piece, fin=False, count=10_000)
                sent += 10_000 * frame_bytes
                await page.writer.drain()
        await page.rest()
        assert any("bytes a second" in why or "malformed message" in why for why in case.refusals())
        assert case.run.asked == []
        assert (await (await case.page()).ask(type="halt"))["ok"]
        measured(f"endless fragments of {len(piece)} bytes: dropped")


LARGEST = b'{"id":1,"type":"delete_segments","numbers":[' + b"1," * 32_000 + b"1]}"


async def test_the_largest_message_again_and_again() -> None:
    """Each is answered, until the client has sent more bytes than any page does."""
    assert 64_000 < len(LARGEST) < 65_536
    async with open_console() as case, raw_page(case) as page:
        turns = Turns(case)
        page.write(TEXT, LARGEST, count=100)
        await page.rest()
        turns.stop()
        assert 1 <= len(turns.messages) <= Limits().bytes_burst / len(LARGEST)
        assert case.run.asked == []
        assert turns.most() == 1


async def test_endless_headers_are_dropped() -> None:
    async with open_console() as case:
        reader, writer = await asyncio.open_connection("127.0.0.1", case.url.port)
        writer.write(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{case.url.port}\r\n".encode())
        with contextlib.suppress(ConnectionError):
            for _ in range(1000):
                writer.write(b"A: b\r\n" * 1000)
                await writer.drain()
                if reader.at_eof():
                    break
            await asyncio.wait_for(reader.read(), TIMEOUT_S)
        writer.transport.abort()
        await case.settled(lambda: bool(case.refusals()), "a refusal")
        assert (await (await case.page()).ask(type="halt"))["ok"]


async def test_hundreds_of_pages_opened_and_closed(measured: Callable[[str], None]) -> None:
    """In a burst and then a few a second: each costs as much as a hundred messages. Clients are limited as well."""
    async with open_console() as case:
        operator, opened, refused = await case.page(), 1, 0

        async def open_and_close() -> None:
            nonlocal opened, refused
            try:
                page = await case.connect()
            except WSServerHandshakeError as error:
                refused += error.status == 503
                return
            opened += 1
            await page.socket.close()
            await case.settled(lambda: len(case.console.hub.clients) == 1, "its departure")

        for _ in range(60):
            await open_and_close()
        assert (opened, refused) == (JOINS_BURST, 61 - JOINS_BURST)
        assert "too many pages are opened at a time" in case.refusals()
        case.clock[0] += 1.0
        for _ in range(6):
            await open_and_close()
        assert opened == JOINS_BURST + Limits().joins_per_s
        assert (await operator.ask(type="halt"))["ok"]
        lines = [line for line in case.log if line["event"].startswith("console ")]
        assert len(lines) <= 4 * (LOG_LINES_BURST + 1), "nor is the log flooded"
        measured(f"60 pages opened and closed at once: {JOINS_BURST} get in, others are refused; HALT counts")


class Slow:
    """A client that reads nothing, joined without a socket."""

    def __init__(self, case: ConsoleCase) -> None:
        self.transport = SlowTransport()
        self.client = case.console.hub.join(self.transport, "slow", case.console._session(), has_token=True)

    @property
    def queued(self) -> list[dict[str, Any]]:
        return [orjson.loads(data) for data in self.client._queue]


async def test_requests_for_control_do_not_fill_the_queue_of_the_holder() -> None:
    """Others can ask as often as they like; a holder that is slow for a moment stays, and gets the newest request."""
    async with open_console() as case:
        holder, first, second = (Slow(case) for _ in range(3))
        for k in range(600):
            case.console.dispatcher.receive((first, second)[k % 2].client, '{"id":1,"type":"take_control"}')
            first.client._queue.clear()
            second.client._queue.clear()
        assert not holder.client.is_gone
        roles = [message for message in holder.queued if message["type"] == "role"]
        assert [message["client"] for message in roles] == [second.client.number]
        assert holder.client._queue_bytes == sum(map(len, holder.client._queue))
        for one in (holder, first, second):
            case.console.hub.leave(one.client)


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


NUMBERS = ["9" * 60_000, "1" + "0" * 400, "-" + "9" * 5000, "1e308", "1e400", "NaN", "-Infinity", "0." + "3" * 60_000]
DEEP = ["[" * 60_000, '{"a":' * 10_000, '{"id":1,"type":"goal","x":' + "[" * 30_000, '{"id":' + "[" * 30_000]


BEYOND = [
    *(f'{{"id":1,"type":"goal","x":{n},"y":0}}' for n in NUMBERS),
    *DEEP,
    '{"id":1,"type":"bookmark","text":"' + "x" * 60_000 + '"}',
    '{"id":1,"type":"' + "halt" * 15_000 + '"}',
]


@pytest.mark.parametrize("text", BEYOND, ids=lambda text: text[:34])
async def test_numbers_depths_and_lengths_beyond_any_use(text: str) -> None:
    """Answered in a few words, and without effect."""
    async with open_console() as case:
        client = Slow(case).client
        client._queue.clear()
        case.console.dispatcher.receive(client, text)
        (answer,) = (orjson.loads(data) for data in client._queue)
        assert answer["ok"] is False
        assert len(orjson.dumps(answer)) < 1000
        assert case.run.asked == []
        case.console.hub.leave(client)
