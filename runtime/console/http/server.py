"""The console's web server: the page's files, the log, recordings, what is made of them, and each client's websocket.

A request carries nothing but its path and its token: the server takes no forms and no uploads. Each response closes
its connection; only websockets stay open.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from aiohttp import WSCloseCode, WSMsgType, web

from drivers.token_bucket import TokenBucket
from runtime.console.clients.client import Client
from runtime.console.clients.client_hub import ClientHub
from runtime.console.http.auth import Auth
from runtime.console.http.client_limits import ConsoleLog, Limits
from runtime.console.http.connection_limits import BACKLOG, ConnectionLimiter
from runtime.console.http.downloads import send_file
from runtime.console.http.log_forwarder import LogForwarder
from runtime.console.http.static_files import StaticFile, security_headers
from runtime.console.timed_coroutine import Timed, timed_coroutine
from runtime.cycle.callbacks import CONSOLE_RECEIVE, CONSOLE_SEND

if TYPE_CHECKING:
    import socket

IDLE_MAX_S: Final = 10.0
"""A connection that sends no request for this long is closed."""
CLOSE_MAX_S: Final = 1.0
"""Time for the closing handshakes at the end of the run."""
REASON_MAX: Final = 200
"""Characters of a peer's words that go into the log."""
HALT_MARK: Final = '"halt"'
"""A message with this near its beginning is read even if its client sends too many."""
HALT_MAX: Final = 200
"""Characters of such a message; only a short one is carried out before the messages of other clients."""
JOINS_BURST: Final = 32
"""New websockets at once: all pages of a run may be reloaded twice."""
REST_MAX_S: Final = 0.1
"""Longest pause after a message, s; longer work was this process being suspended."""
FILE_NAME_MAX: Final = 255
"""Bytes of a file's name, as of most file systems."""
DOWNLOADS: Final = ("/recording", "/made")
"""Paths of recordings and of files that jobs made."""
WRONG_TOKEN: Final = "a wrong token, or none"  # noqa: S105 - a text


@dataclass(frozen=True, slots=True)
class ServerContext:
    """The content that the server serves, and its callbacks."""

    auth: Auth
    hub: ClientHub
    limits: Limits
    log: ConsoleLog
    files: Mapping[str, StaticFile]
    session: Callable[[], Mapping[str, Any]]
    """Returns the session information for a new client."""
    on_message: Callable[[Client, str], None]
    """Gets a client's message; does not raise for what a client can cause."""
    on_leave: Callable[[Client], None]
    on_fault: Callable[[str, BaseException], None]
    """Gets the name of a part and the unexpected error in it."""
    file_of: Callable[[str, str, str], Awaitable[Path | None]]
    """Returns the path of the file that a request of `DOWNLOADS` means: its path, job and name."""
    watch_without_token: bool
    timed: Timed
    clock: Callable[[], float]
    """Monotonic, s."""


class _WebSocketTransport:
    """A websocket as a client's transport."""

    def __init__(self, websocket: web.WebSocketResponse, transport: asyncio.Transport) -> None:
        self._websocket = websocket
        self._transport = transport

    async def send(self, data: bytes) -> None:
        """Send a message; `writer_limit` makes it wait while the system takes nothing more."""
        await self._websocket.send_frame(data, WSMsgType.TEXT)

    def abort(self) -> None:
        """Drop the connection."""
        self._transport.abort()


class Server:
    """Serves one console."""

    def __init__(self, context: ServerContext) -> None:
        self._context = context
        self._websockets: dict[Client, web.WebSocketResponse] = {}
        """Of each client that is connected."""
        self._web: web.Server | None = None
        self._server: asyncio.Server | None = None
        self._limiter: ConnectionLimiter | None = None
        self._is_closing = False
        self._joins = TokenBucket(context.limits.joins_per_s, JOINS_BURST)
        self._turn = asyncio.Lock()
        """Of the client whose message is carried out; clients get it in the order in which they ask."""

    async def open(self, listening: socket.socket) -> None:
        """Serve the connections of a listening socket."""
        context = self._context
        logger = logging.Logger("console")
        logger.addHandler(LogForwarder(context.log))
        self._web = web_server = web.Server(
            self._answer,
            access_log=None,
            logger=logger,
            keepalive_timeout=IDLE_MAX_S,
            lingering_time=0.0,
            auto_decompress=False,
        )
        self._limiter = ConnectionLimiter(
            web_server,
            context.limits,
            context.timed,
            lambda reason: context.log.refuse(reason, "a connection"),
            context.clock,
        )
        self._server = await asyncio.get_running_loop().create_server(self._limiter, sock=listening, backlog=BACKLOG)

    @property
    def is_open(self) -> bool:
        """Whether it listens."""
        return self._server is not None and self._server.is_serving()

    async def close(self) -> None:
        """Close every connection and stop listening."""
        self._is_closing = True
        if self._server is not None:
            self._server.close()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(CLOSE_MAX_S):
                closing = (_close_run_over(websocket) for websocket in list(self._websockets.values()))
                await asyncio.gather(*closing, return_exceptions=True)
        for client in list(self._websockets):
            client.disconnect()
        if self._web is not None:
            await self._web.shutdown(CLOSE_MAX_S)

    async def _answer(self, request: web.BaseRequest) -> web.StreamResponse:
        """Return the response to a request, with its headers; report unexpected errors."""
        host = request.headers.get("Host")
        problem = self._context.auth.host_error(host, local_address(request))
        if problem is not None or host is None:
            response: web.StreamResponse = self._refuse(
                request, HTTPStatus.MISDIRECTED_REQUEST, problem or "no Host header"
            )
            response.force_close()
            return response
        try:
            response = await self._respond(request, host)
        except ConnectionError:
            raise
        except web.HTTPException as error:
            # aiohttp rejects a malformed websocket handshake this way.
            response = self._refuse(request, HTTPStatus(error.status), "a malformed request")
        except Exception as error:  # noqa: BLE001 - reported as a fault of the program; the server continues
            self._context.on_fault("the console", error)
            response = web.Response(status=500, text="the console failed: see the log")
        if not isinstance(response, web.WebSocketResponse):
            response.headers.update(security_headers(host))
            response.force_close()
        return response

    async def _respond(self, request: web.BaseRequest, host: str) -> web.StreamResponse:
        """Return the response to a request whose Host is right: a page's file, a websocket, the log or a download."""
        context, path = self._context, request.path
        if request.method != "GET":
            return self._refuse(request, HTTPStatus.METHOD_NOT_ALLOWED, f"the method {request.method[:20]!a}")
        if path == "/ws":
            return await self._open_websocket(request, host)
        if path in context.files:
            file = context.files[path]
            return web.Response(body=file.body, headers={"Content-Type": file.content_type})
        if path not in {"/log", *DOWNLOADS}:
            return web.Response(status=404, text="there is no such page")
        if not self._has_token(request):
            return self._refuse(request, HTTPStatus.FORBIDDEN, WRONG_TOKEN)
        if path in DOWNLOADS:
            return await self._download(request, host)
        return web.Response(body=context.hub.log_lines, content_type="application/x-ndjson")

    async def _download(self, request: web.BaseRequest, host: str) -> web.StreamResponse:
        """Send a recording, or a file that a job made."""
        context, name = self._context, request.query.get("file", "")
        if len(name.encode(errors="replace")) > FILE_NAME_MAX or not name.isprintable():
            return self._refuse(request, HTTPStatus.BAD_REQUEST, "a name that no file can have")
        file = await context.file_of(request.path, request.query.get("job", ""), name)
        if file is None:
            return web.Response(status=404, text="there is no such file: list the files again")
        try:
            sending = send_file(request, file, security_headers(host))
            return await timed_coroutine(context.timed, CONSOLE_SEND, sending)
        except OSError as error:
            if isinstance(error, ConnectionError):
                raise
            return web.Response(status=HTTPStatus.CONFLICT, text=f"the file cannot be read: {error.strerror}")

    async def _open_websocket(self, request: web.BaseRequest, host: str) -> web.StreamResponse:
        """Add a client and serve its websocket until it leaves; return the response, or why it is refused."""
        context = self._context
        has_token = self._has_token(request)
        if not has_token and not (context.watch_without_token and "token" not in request.query):
            return self._refuse(request, HTTPStatus.FORBIDDEN, WRONG_TOKEN)
        if request.headers.get("Upgrade", "").lower() != "websocket":
            return web.Response(status=HTTPStatus.UPGRADE_REQUIRED, text="this address serves websockets only")
        problem = context.auth.origin_error(request.headers.get("Origin"), host)
        if problem is not None:
            return self._refuse(request, HTTPStatus.FORBIDDEN, problem)
        if context.hub.is_full:
            return self._refuse(request, HTTPStatus.SERVICE_UNAVAILABLE, "too many pages are open")
        if not self._joins.take(context.clock()):
            return self._refuse(request, HTTPStatus.SERVICE_UNAVAILABLE, "too many pages are opened at a time")
        websocket = web.WebSocketResponse(
            compress=False,
            max_msg_size=context.limits.message_bytes + 1,
            writer_limit=1,
            timeout=CLOSE_MAX_S,
            autoping=False,
        )
        await websocket.prepare(request)
        transport = request.transport
        if transport is None or self._is_closing:
            return websocket
        transport.set_write_buffer_limits(high=0)
        if self._limiter is not None:
            self._limiter.release(transport)
        client = context.hub.join(
            _WebSocketTransport(websocket, transport), str(request.remote), context.session(), has_token=has_token
        )
        self._websockets[client] = websocket
        context.log.note("console page opened", client=client.name)
        await timed_coroutine(context.timed, CONSOLE_RECEIVE, self._serve(client, websocket))
        return websocket

    async def _serve(self, client: Client, websocket: web.WebSocketResponse) -> None:
        """Receive from a client and send to it until either ends."""
        context = self._context
        sender = asyncio.create_task(self._send(client), name=f"console sender {client.number}")
        try:
            await self._receive(client, websocket)
        except asyncio.CancelledError as error:
            if not self._is_closing:
                context.on_fault(f"task `console client {client.number}`", error)
            raise
        except Exception as error:  # noqa: BLE001 - reported as a fault of the program; only this client is dropped
            context.on_fault(f"task `console client {client.number}`", error)
            client.disconnect()
        finally:
            self._websockets.pop(client, None)
            client.leave()
            context.hub.leave(client)
            context.on_leave(client)
            context.log.note("console page closed", client=client.name)
            sender.cancel()
            await asyncio.gather(sender, return_exceptions=True)

    async def _receive(self, client: Client, websocket: web.WebSocketResponse) -> None:
        """Take messages until the client leaves or is dropped; a ping counts as a message."""
        context = self._context
        while True:
            message = await websocket.receive()
            if message.type not in {WSMsgType.TEXT, WSMsgType.PING, WSMsgType.PONG}:
                if message.type is WSMsgType.BINARY:
                    context.log.refuse("a binary message", client.name)
                    await websocket.close(code=WSCloseCode.UNSUPPORTED_DATA, message=b"text only")
                elif message.type is WSMsgType.ERROR:
                    context.log.refuse(f"a malformed message: {message.data}"[:REASON_MAX], client.name)
                return
            is_too_fast = not client.message_bucket.take(context.clock())
            if message.type is WSMsgType.TEXT:
                if not is_too_fast or HALT_MARK in message.data[:HALT_MAX]:
                    await self._carry_out(client, message.data)
            elif message.type is WSMsgType.PING and not is_too_fast:
                await websocket.pong(message.data)
            if is_too_fast:
                context.log.refuse(f"more than {context.limits.messages_per_s:g} messages a second", client.name)
                await websocket.close(code=WSCloseCode.POLICY_VIOLATION, message=b"too many messages")
                return

    async def _carry_out(self, client: Client, text: str) -> None:
        """Carry out a message in this client's turn, and rest, so that clients cannot fill the loop's time.

        A HALT waits for no turn. In each turn of the loop it is one of each client, and one other message of all.
        """
        context = self._context
        if len(text) <= HALT_MAX and HALT_MARK in text:
            context.on_message(client, text)
            await asyncio.sleep(0.0)
            return
        async with self._turn:
            if client.is_gone:
                return
            begin_s = context.clock()
            context.on_message(client, text)
            rest_s = (context.clock() - begin_s) * (1.0 / context.limits.loop_share - 1.0)
            await asyncio.sleep(min(rest_s, REST_MAX_S))

    async def _send(self, client: Client) -> None:
        """Send to a client until it is gone; report every end but that one as a fault."""
        context = self._context
        try:
            await timed_coroutine(context.timed, CONSOLE_SEND, client.send_all())
        except ConnectionError:
            client.leave()
        except asyncio.CancelledError as error:
            if not client.is_gone:
                context.on_fault(f"task `console sender {client.number}`", error)
                client.disconnect()
            raise
        except Exception as error:  # noqa: BLE001 - reported as a fault of the program; only this client is dropped
            context.on_fault(f"task `console sender {client.number}`", error)
            client.disconnect()

    def _has_token(self, request: web.BaseRequest) -> bool:
        token = request.query.get("token")
        return token is not None and self._context.auth.accepts(token)

    def _refuse(self, request: web.BaseRequest, status: HTTPStatus, reason: str) -> web.Response:
        log = self._context.log
        (log.refuse_token if reason == WRONG_TOKEN else log.refuse)(reason, str(request.remote))
        return web.Response(status=status, text=reason)


def local_address(request: web.BaseRequest) -> str:
    """Return the address of this machine to which a request came, empty if unknown."""
    name = None if request.transport is None else request.transport.get_extra_info("sockname")
    # An IPv6 socket shows an IPv4 address in its mapped form; the peer knows the plain one.
    return str(name[0]).removeprefix("::ffff:") if name else ""


async def _close_run_over(websocket: web.WebSocketResponse) -> None:
    await websocket.close(code=WSCloseCode.GOING_AWAY, message=b"the run is over")
