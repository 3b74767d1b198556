"""A client with the token that floods, never reads, or sends what is not a message: answered or dropped, and bounded.

What it costs the run is counted: messages in a turn of the loop, and bytes kept. The HALT of another client is
carried out in the turns in which it arrives.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import gzip
import os
import tracemalloc
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import pytest
from aiohttp import WSServerHandshakeError

from runtime.console.clients.challenges import KEPT
from runtime.console.clients.client import Client
from runtime.console.http.client_limits import LOG_LINES_BURST, Limits
from runtime.console.http.connection_limits import TimedProtocol
from runtime.console.http.server import JOINS_BURST
from runtime.cycle.callbacks import CONSOLE_RECEIVE
from runtime.cycle.inputs import Request
from runtime.timing.timing_monitor import SPANS_MAX
from tests.hil.machine import TIMEOUT_S
from tests.runtime.console.console_case import ConsoleCase, Page, open_console
from tests.runtime.console.raw_page import raw_page

pytestmark = pytest.mark.promise("P22")

BOUNDLESS = Limits(messages_per_s=1e9, bytes_burst=1e12)
"""So that the bounds on a turn of the loop show alone."""
TEXT, PING, PONG, CONTINUATION = 0x1, 0x9, 0xA, 0x0
TURNS_MAX = 3
"""Turns of the loop from the arrival of a message until it is carried out: two to wake its task, and one spare."""


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


SMALL = b'{"id":1,"type":"evidence","object":1}'
COMMANDS = 100_000


async def test_a_hundred_thousand_commands_of_one_client(measured: Callable[[str], None]) -> None:
    """As many as it may send in a second are carried out, one in a turn; then it gets the reason and is dropped."""
    async with open_console() as case:
        turns, other = Turns(case), await case.page()
        async with raw_page(case) as page:
            page.write(TEXT, SMALL, count=COMMANDS)
            await page.rest()
        turns.stop()
        carried_out = len(turns.messages)
        assert carried_out <= Limits().messages_per_s
        assert turns.most() == 1
        assert (await other.ask(type="halt"))["ok"]
        assert case.run.asked == [Request.HALT]
        assert any("200 messages a second" in why or "bytes a second" in why for why in case.refusals())
        measured(f"{COMMANDS:,} commands at once: {carried_out} carried out, {turns.most()} in a turn")


@dataclass
class Arrivals:
    """Bytes that the console reads: from which transport, and in which turn of the loop."""

    turns: Turns | None = None
    seen: list[tuple[Any, int]] = field(default_factory=list)

    def note(self, transport: object) -> None:
        """Note that bytes have arrived."""
        if self.turns is not None:
            self.seen.append((transport, self.turns.turn))

    async def halt_turns(self, turns: Turns, operator: Page, number: int) -> int:
        """Press HALT; return how many turns of the loop after its arrival it was carried out."""
        self.turns, self.seen, mark = turns, [], f'"id":{number},'
        await operator.socket.send_str(f'{{"id":{number},"type":"halt"}}')
        await turns.case.settled(lambda: any(mark in text for _, text in turns.messages), "the HALT")
        client: Any = turns.case.console.hub.clients[1]
        arrived_in = next(turn for transport, turn in self.seen if transport is client._transport._transport)
        return next(turn for turn, text in turns.messages if mark in text) - arrived_in


@pytest.fixture
def arrivals(monkeypatch: pytest.MonkeyPatch) -> Arrivals:
    arrivals, received = Arrivals(), TimedProtocol._received

    def noted(protocol: TimedProtocol, data: bytes) -> None:
        arrivals.note(protocol._transport)
        received(protocol, data)

    monkeypatch.setattr(TimedProtocol, "_received", noted)
    return arrivals


async def test_halt_passes_the_floods_of_all_other_clients(
    arrivals: Arrivals, measured: Callable[[str], None]
) -> None:
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
            took.append(await arrivals.halt_turns(turns, operator, 100 + k))
        turns.stop()
        assert len(turns.messages) < 8 * count, "the floods were not over yet"
        assert turns.most() == 1
        assert max(took) <= TURNS_MAX
        assert case.run.asked == [Request.HALT] * 5
        measured(f"HALT amid the floods of {len(floods)} clients: at most {TURNS_MAX} turns of the loop")


async def test_a_flood_of_halts_keeps_no_other_halt_waiting(arrivals: Arrivals) -> None:
    async with open_console(limits=BOUNDLESS) as case:
        turns, operator = Turns(case), await case.page()
        async with raw_page(case) as flood:
            flood.write(TEXT, b'{"id":1,"type":"halt"}', count=1000)
            await case.settled(partial(turns.have_been, 20), "the flood")
            assert await arrivals.halt_turns(turns, operator, 100) <= TURNS_MAX
            turns.stop()
            of_flood = [turn for turn, text in turns.messages if '"id":1,' in text]
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


@pytest.mark.parametrize("opcode", [PING, PONG])
async def test_pings_and_unasked_pongs_count_as_messages(opcode: int) -> None:
    async with open_console() as case, raw_page(case) as page:
        page.write(opcode, b"0123456789", count=5000)
        rest = await page.rest()
        assert rest.count(b"\x8a\x0a0123456789") <= Limits().messages_per_s
        assert any("messages a second" in why for why in case.refusals())
        assert (await (await case.page()).ask(type="halt"))["ok"]


async def test_a_ping_is_answered() -> None:
    async with open_console() as case, raw_page(case) as page:
        page.write(PING, b"0123456789")
        await asyncio.wait_for(page.reader.readuntil(b"\x8a\x0a0123456789"), TIMEOUT_S)


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


CACHED_MAX = 500
"""Objects in caches that are not filled yet."""
OBJECTS_A_PAGE_MAX = 5.0
"""Objects that may be left of each page, in the mean: those of one client and its websocket are far more."""


def fill_caches_of_time(case: ConsoleCase) -> None:
    """Fill what keeps the newest challenges and spans of time: how many come in a test depends on the machine."""
    for _ in range(KEPT):
        case.console.hub.challenges.issue()
    span = case.run.timing_monitor.timed(CONSOLE_RECEIVE, lambda: None)
    for _ in range(SPANS_MAX):
        span()


@pytest.mark.promise("P15")
@pytest.mark.parametrize("pages", [30, pytest.param(20_000, marks=pytest.mark.soak)])
async def test_pages_that_come_and_go_leave_nothing(pages: int, measured: Callable[[str], None]) -> None:
    """They close in order or lose their connection, ask for control, and watch or not."""

    def left() -> tuple[int, int]:
        gc.collect()
        return len(gc.get_objects()), len(os.listdir("/proc/self/fd"))  # noqa: PTH208

    async with open_console() as case:
        await case.settled(lambda: not case.console._tasks, "the reader of commands")
        tasks = len(asyncio.all_tasks())

        async def come_and_go(number: int) -> None:
            case.cycles(step_s=1.0)
            page, other = await case.page(), await case.page()
            if number % 2:
                await other.ask(type="take_control")
                transport = page.socket._conn.transport  # type: ignore[union-attr]
                assert transport is not None
                transport.abort()
            await page.socket.close()
            await other.socket.close()
            await case.settled(lambda: len(asyncio.all_tasks()) == tasks, "the end of their tasks")
            assert not case.console.hub.clients
            for kept in (case.sockets, case.log, case.run.asked, case.run.validity):
                kept.clear()

        for number in range(10):  # by then most caches are filled
            await come_and_go(number)
        fill_caches_of_time(case)
        before = left()
        for number in range(pages // 2):
            await come_and_go(number)
        await case.settled(lambda: left()[1] == before[1], "the file descriptors of before")
        after = left()
    assert after[0] - before[0] < CACHED_MAX + OBJECTS_A_PAGE_MAX * pages
    measured(f"{pages:,} pages opened and closed: {after[0] - before[0]} objects more than before")


@contextlib.contextmanager
def allocating_less_than(limit_bytes: int) -> Iterator[None]:
    """Check the most memory that is allocated at a time."""
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        yield
        assert tracemalloc.get_traced_memory()[1] - before < limit_bytes
    finally:
        tracemalloc.stop()


BOMB_BYTES = 50_000_000


@pytest.mark.parametrize("fragments", [1, 3])
async def test_a_compressed_bomb_is_not_decompressed(fragments: int, measured: Callable[[str], None]) -> None:
    compressor = zlib.compressobj(9, zlib.DEFLATED, -15)
    bomb = compressor.compress(b" " * BOMB_BYTES) + compressor.flush(zlib.Z_SYNC_FLUSH)
    piece = bomb[:60_000]
    async with open_console() as case:
        async with raw_page(case, "Sec-WebSocket-Extensions: permessage-deflate; client_no_context_takeover") as page:
            with allocating_less_than(2_000_000):
                for k in range(fragments):
                    page.write(CONTINUATION if k else TEXT, piece, fin=k == fragments - 1, compressed=k == 0)
                assert await page.rest() != b"", "it gets the reason"
        assert "reserved bits" in case.refusals()[-1]
        assert (await (await case.page()).ask(type="halt"))["ok"]
    measured("a websocket message of 60 kB that would be 50 MB: dropped, and not decompressed")


@pytest.mark.parametrize("encoding", ["gzip", "deflate"])
async def test_a_compressed_request_is_not_decompressed(encoding: str) -> None:
    body = (gzip if encoding == "gzip" else zlib).compress(b" " * BOMB_BYTES)
    async with open_console() as case:
        with allocating_less_than(2_000_000):
            reader, writer = await asyncio.open_connection("127.0.0.1", case.url.port)
            writer.write(
                f"GET /ws HTTP/1.1\r\nHost: 127.0.0.1:{case.url.port}\r\nContent-Encoding: {encoding}\r\n"
                f"Content-Length: {len(body)}\r\n\r\n".encode()
                + body
            )
            with contextlib.suppress(ConnectionError):
                await asyncio.wait_for(reader.read(-1), TIMEOUT_S)
            writer.transport.abort()
        assert (await (await case.page()).ask(type="halt"))["ok"]
