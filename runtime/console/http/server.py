"""The console's side of the network: pages, and the websocket of each client, behind the guard.

A request brings nothing but its address: there is no form to fill in, no file to send. Each is answered and its
connection closed, so that nobody holds one for long; only a websocket stays.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from typing import TYPE_CHECKING, Any, Final

from aiohttp import WSCloseCode, WSMsgType, web

from runtime.console.clients.client import Client
from runtime.console.clients.client_hub import Hub
from runtime.console.commands.command_error import CommandError
from runtime.console.http.auth import Auth
from runtime.console.http.client_limits import ConsoleLog, Limits
from runtime.console.http.connection_limits import ConnectionLimiter
from runtime.console.http.static_files import File, headers
from runtime.console.timed_coroutine import Timed, timed_coroutine
from runtime.cycle.process import CONSOLE_RECEIVE, CONSOLE_SEND

if TYPE_CHECKING:
    import socket

IDLE_MAX_S: Final = 10.0
"""For a connection that asks for nothing."""
CLOSE_MAX_S: Final = 1.0
HALT_WORD: Final = '"halt"'


@dataclass(frozen=True, slots=True)
class ServerContext:
    """What the server serves, and whom it tells."""

    guard: Auth
    hub: Hub
    limits: Limits
    notes: ConsoleLog
    files: Mapping[str, File]
    hello: Callable[[], Mapping[str, Any]]
    """What a new client is told."""
    on_message: Callable[[Client, str], None]
    """Gets what a client says; it does not raise for that."""
    on_leave: Callable[[Client], None]
    on_fault: Callable[[str, BaseException], None]
    """Gets the name of a part and what it should never have met."""
    report: Callable[[], Awaitable[bytes]]
    """Returns the run up to now as a page; raises a CommandError."""
    watch_without_token: bool
    timed: Timed
    clock: Callable[[], float]


class _Wire:
    """A websocket, as a client sees it."""

    def __init__(self, talk: web.WebSocketResponse, transport: asyncio.Transport) -> None:
        self._talk = talk
        self._transport = transport

    async def send(self, data: bytes) -> None:
        """Put a message on the way; `writer_limit` has it wait while the system takes nothing more."""
        await self._talk.send_frame(data, WSMsgType.TEXT)

    def abort(self) -> None:
        """Cut the connection."""
        self._transport.abort()


class _Murmur(logging.Handler):
    """Tells of what aiohttp would print with a traceback: a peer that does not speak HTTP, mostly."""

    def __init__(self, notes: ConsoleLog) -> None:
        super().__init__()
        self._notes = notes

    def emit(self, record: logging.LogRecord) -> None:
        """Take a line."""
        error = record.exc_info[1] if record.exc_info else None
        why = f"{record.getMessage()}{f': {type(error).__name__}' if error else ''}"
        self._notes.refuse(ascii(why)[1:-1][:200], "a connection")


class Server:
    """Serves one console.

    Parameters
    ----------
    house : ServerContext
        What it serves.
    """

    def __init__(self, house: ServerContext) -> None:
        self._house = house
        self._talks: dict[Client, web.WebSocketResponse] = {}
        self._web: web.Server | None = None
        self._server: asyncio.Server | None = None
        self._door: ConnectionLimiter | None = None
        self._is_closing = False

    async def open(self, listening: socket.socket) -> None:
        """Serve whoever comes to a socket that listens."""
        murmur = logging.Logger("console")
        murmur.addHandler(_Murmur(self._house.notes))
        self._web = server = web.Server(
            self._answer, access_log=None, logger=murmur, keepalive_timeout=IDLE_MAX_S, lingering_time=0.0
        )
        house = self._house
        self._door = door = ConnectionLimiter(
            server, house.limits.connections, house.timed, lambda why: house.notes.refuse(why, "a connection"),
            house.clock,
        )  # fmt: skip
        self._server = await asyncio.get_running_loop().create_server(door, sock=listening)

    @property
    def is_open(self) -> bool:
        """Whether it listens."""
        return self._server is not None and self._server.is_serving()

    async def close(self) -> None:
        """Let everybody go, and leave nothing behind."""
        self._is_closing = True
        if self._server is not None:
            self._server.close()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(CLOSE_MAX_S):
                await asyncio.gather(*(_bye(talk) for talk in list(self._talks.values())), return_exceptions=True)
        for client in list(self._talks):
            client.cut()
        if self._web is not None:
            await self._web.shutdown(CLOSE_MAX_S)

    async def _answer(self, request: web.BaseRequest) -> web.StreamResponse:
        """Answer one request."""
        host = request.headers.get("Host")
        trouble = self._house.guard.trouble_with_host(host, local_address(request))
        if trouble is not None or host is None:
            response: web.StreamResponse = self._refused(
                request, HTTPStatus.MISDIRECTED_REQUEST, trouble or "no Host"
            )
            response.force_close()
            return response
        try:
            response = await self._respond(request, host)
        except ConnectionError:
            raise
        except web.HTTPException as error:
            # A handshake that is none, as aiohttp has it.
            response = self._refused(request, HTTPStatus(error.status), "a request that is none")
        except Exception as error:  # noqa: BLE001 - told as a fault of the program, without ending anything
            self._house.on_fault("the console", error)
            response = web.Response(status=500, text="the console failed: see the log")
        if not isinstance(response, web.WebSocketResponse):
            response.headers.update(headers(host))
            response.force_close()
        return response

    async def _respond(self, request: web.BaseRequest, host: str) -> web.StreamResponse:
        house, path = self._house, request.path
        if request.method != "GET":
            return self._refused(request, HTTPStatus.METHOD_NOT_ALLOWED, f"the method {request.method[:20]!a}")
        if path == "/ws":
            return await self._talk(request, host)
        if path in house.files:
            file = house.files[path]
            return web.Response(body=file.body, headers={"Content-Type": file.kind})
        if path not in {"/report", "/log"}:
            return web.Response(status=404, text="there is no such page")
        if not self._knows(request):
            return self._refused(request, HTTPStatus.FORBIDDEN, "a wrong token, or none")
        if path == "/log":
            return web.Response(body=house.hub.lines, content_type="application/x-ndjson")
        try:
            page = await house.report()
        except CommandError as refusal:
            return web.Response(status=HTTPStatus.CONFLICT, text=str(refusal))
        return web.Response(body=page, content_type="text/html", charset="utf-8")

    async def _talk(self, request: web.BaseRequest, host: str) -> web.StreamResponse:
        """Talk to a client for as long as it stays."""
        house = self._house
        has_token = self._knows(request)
        if not has_token and not (house.watch_without_token and "token" not in request.query):
            return self._refused(request, HTTPStatus.FORBIDDEN, "a wrong token, or none")
        if request.headers.get("Upgrade", "").lower() != "websocket":
            return web.Response(status=HTTPStatus.UPGRADE_REQUIRED, text="this is for websockets")
        trouble = house.guard.trouble_with_origin(request.headers.get("Origin"), host)
        if trouble is not None:
            return self._refused(request, HTTPStatus.FORBIDDEN, trouble)
        if house.hub.is_full:
            return self._refused(request, HTTPStatus.SERVICE_UNAVAILABLE, "as many pages are open as there may be")
        talk = web.WebSocketResponse(
            compress=False, max_msg_size=house.limits.message_bytes + 1, writer_limit=1, timeout=CLOSE_MAX_S
        )
        await talk.prepare(request)
        transport = request.transport
        if transport is None or self._is_closing:
            return talk
        transport.set_write_buffer_limits(high=0)
        if self._door is not None:
            self._door.settle(transport)
        client = house.hub.join(_Wire(talk, transport), str(request.remote), house.hello(), has_token=has_token)
        self._talks[client] = talk
        house.notes.tell("a page of the console is open", client.name)
        await timed_coroutine(house.timed, CONSOLE_RECEIVE, self._stay(client, talk))
        return talk

    async def _stay(self, client: Client, talk: web.WebSocketResponse) -> None:
        """Hear a client and send to it, until either ends."""
        house = self._house
        sender = asyncio.create_task(self._send(client), name=f"console sender {client.number}")
        try:
            await self._hear(client, talk)
        except asyncio.CancelledError as error:
            if not self._is_closing:
                house.on_fault(f"task `console client {client.number}`", error)
            raise
        except Exception as error:  # noqa: BLE001 - told as a fault of the program; only this client goes
            house.on_fault(f"task `console client {client.number}`", error)
            client.cut()
        finally:
            self._talks.pop(client, None)
            client.leave()
            house.hub.leave(client)
            house.on_leave(client)
            house.notes.tell("a page of the console is gone", client.name)
            sender.cancel()
            await asyncio.gather(sender, return_exceptions=True)

    async def _hear(self, client: Client, talk: web.WebSocketResponse) -> None:
        house = self._house
        while True:
            message = await talk.receive()
            if message.type is not WSMsgType.TEXT:
                if message.type is WSMsgType.BINARY:
                    house.notes.refuse("a message that is no text", client.name)
                    await talk.close(code=WSCloseCode.UNSUPPORTED_DATA, message=b"text only")
                elif message.type is WSMsgType.ERROR:
                    house.notes.refuse(f"a message that is none: {message.data}"[:200], client.name)
                return
            is_over = not client.bucket.take(house.clock())
            if not is_over or HALT_WORD in message.data[:200]:
                house.on_message(client, message.data)
            if is_over:
                house.notes.refuse(f"more than {house.limits.messages_per_s:g} messages a second", client.name)
                await talk.close(code=WSCloseCode.POLICY_VIOLATION, message=b"too many messages")
                return

    async def _send(self, client: Client) -> None:
        """Send to a client; that it is gone is no fault, anything else is."""
        try:
            await timed_coroutine(self._house.timed, CONSOLE_SEND, client.send_all())
        except ConnectionError:
            client.leave()
        except asyncio.CancelledError as error:
            if not client.is_gone:
                self._house.on_fault(f"task `console sender {client.number}`", error)
                client.cut()
            raise
        except Exception as error:  # noqa: BLE001 - told as a fault of the program; only this client goes
            self._house.on_fault(f"task `console sender {client.number}`", error)
            client.cut()

    def _knows(self, request: web.BaseRequest) -> bool:
        token = request.query.get("token")
        return token is not None and self._house.guard.knows(token)

    def _refused(self, request: web.BaseRequest, status: HTTPStatus, why: str) -> web.Response:
        self._house.notes.refuse(why, str(request.remote))
        return web.Response(status=status, text=why)


def local_address(request: web.BaseRequest) -> str:
    """Return the address of ours to which a request came."""
    name = None if request.transport is None else request.transport.get_extra_info("sockname")
    # An IPv4 peer of an IPv6 socket asks for the address as it knows it.
    return str(name[0]).removeprefix("::ffff:") if name else ""


async def _bye(talk: web.WebSocketResponse) -> None:
    await talk.close(code=WSCloseCode.GOING_AWAY, message=b"the run is over")
