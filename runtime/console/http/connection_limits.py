"""The listening socket, and the limits on connections before their first request.

Requests are parsed in the run's loop, so the time that takes is measured. Socket buffers are small, which bounds what
one peer can have in flight, and both the number of connections and their rate are limited.
"""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from typing import Final

from config.errors import WRONG_CALL, UserError
from config.settings import ConsoleConfig
from drivers.token_bucket import TokenBucket
from runtime.console.http.client_limits import Limits
from runtime.console.timed_coroutine import Timed
from runtime.cycle.callbacks import CONSOLE_RECEIVE

PORTS_TRIED: Final = 20
"""How many successive ports are tried before any free one is taken."""
ANY_FREE_PORT: Final = 0
PORT_MAX: Final = 65_535
BACKLOG: Final = 32
"""Connections that wait, and that one turn of the loop accepts."""
RECEIVE_BUFFER_BYTES: Final = 16 * 1024
"""The system doubles it for its own bookkeeping; nothing larger arrives in one piece."""
SEND_BUFFER_BYTES: Final = 64 * 1024
"""What may be in flight to a client; all of it is older than the newest frame."""
CONNECTIONS_PER_S: Final = 200.0
CONNECTIONS_BURST: Final = 600.0
"""A page is half a hundred files, each fetched by its own connection."""


async def listen(config: ConsoleConfig, before: int | None = None) -> socket.socket:
    """Return a socket that listens on the configured host and port, or on the next free port.

    The port `before` a restart is tried first.

    Raises
    ------
    UserError
        This machine has no such address, or no port is free.
    """
    loop = asyncio.get_running_loop()
    try:
        found = await loop.getaddrinfo(config.host, 0, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except OSError as error:
        raise UserError(
            f"console.host = {config.host!r} is not an address of this machine: {error.strerror}; "
            "use 127.0.0.1 to serve this machine alone",
            WRONG_CALL,
        ) from error
    family, _, _, _, address = found[0]
    problem = ""
    wanted = range(config.port, min(config.port + PORTS_TRIED, PORT_MAX + 1)) if config.port else ()
    for port in (*(() if before is None else (before,)), *wanted, ANY_FREE_PORT):
        listening = socket.socket(family, socket.SOCK_STREAM)
        try:
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
            listening.bind((address[0], port, *address[2:]))
            listening.listen(BACKLOG)
        except OSError as error:
            listening.close()
            problem = error.strerror or str(error)
            continue
        listening.setblocking(False)  # noqa: FBT003 - the method's name says what the flag means
        return listening
    raise UserError(
        f"the console cannot listen on {config.host}, port {config.port}: {problem}; choose another console.host or "
        "console.port, or run with --no-console"
    )


class TimedProtocol(asyncio.Protocol):
    """Forwards everything to another protocol and measures the time that takes.

    `inner` handles the connection. `accepts` gets the number of bytes that have come, and returns whether the peer
    may send so many; `on_lost` is called when the connection has ended.
    """

    def __init__(
        self,
        inner: asyncio.Protocol,
        timed: Timed,
        accepts: Callable[[int], bool],
        on_lost: Callable[[TimedProtocol], None],
    ) -> None:
        self._inner = inner
        self._accepts = accepts
        self._on_lost = on_lost
        self._transport: asyncio.Transport | None = None
        """None before the connection is made."""
        self._is_aborted = False
        """Whether the connection was dropped, and what comes from it is ignored."""
        # asyncio looks its callbacks up on the object, so attributes can take the place of methods.
        self.connection_made = timed(CONSOLE_RECEIVE, self._made)  # type: ignore[method-assign]  # as said above
        self.data_received = timed(CONSOLE_RECEIVE, self._received)  # type: ignore[method-assign]  # as said above
        self.connection_lost = timed(CONSOLE_RECEIVE, self._lost)  # type: ignore[method-assign]  # as said above
        self.eof_received = inner.eof_received  # type: ignore[method-assign]  # as said above
        self.pause_writing = inner.pause_writing  # type: ignore[method-assign]  # as said above
        self.resume_writing = inner.resume_writing  # type: ignore[method-assign]  # as said above

    def abort(self) -> None:
        """Drop the connection, at once or as soon as it is made."""
        self._is_aborted = True
        if self._transport is not None:
            self._transport.abort()

    def _made(self, transport: asyncio.BaseTransport) -> None:
        self._inner.connection_made(transport)
        if isinstance(transport, asyncio.Transport):
            self._transport = transport
        if self._is_aborted:
            self.abort()

    def _received(self, data: bytes) -> None:
        """Take bytes, before the HTTP library spends time on them; drop a peer that sends too many."""
        if self._is_aborted:
            return
        if self._accepts(len(data)):
            self._inner.data_received(data)
        else:
            self.abort()

    def _lost(self, error: Exception | None) -> None:
        self._on_lost(self)
        self._inner.connection_lost(error)


class RejectingProtocol(asyncio.Protocol):
    """Drops a connection as soon as it is made."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Drop it."""
        if isinstance(transport, asyncio.Transport):
            transport.abort()


class ConnectionLimiter:
    """The protocol factory of the server, which limits the connections that are not websockets yet.

    One connection too many has the oldest dropped, so that holding connections open keeps no one else out.

    `make_protocol` makes what handles a connection; `on_refused` gets the reason why one is rejected or dropped. The
    clock is monotonic.
    """

    def __init__(
        self,
        make_protocol: Callable[[], asyncio.Protocol],
        limits: Limits,
        timed: Timed,
        on_refused: Callable[[str], None],
        clock: Callable[[], float],
    ) -> None:
        self._make_protocol = make_protocol
        self._pending: dict[TimedProtocol, None] = {}  # in the order in which they came
        self._limits = limits
        self._timed = timed
        self._on_refused = on_refused
        self._clock = clock
        self._bucket = TokenBucket(CONNECTIONS_PER_S, CONNECTIONS_BURST)

    def __call__(self) -> asyncio.Protocol:
        """Return the protocol of a new connection."""
        if not self._bucket.take(self._clock()):
            self._on_refused("too many new connections a second")
            return RejectingProtocol()
        if len(self._pending) >= self._limits.connections:
            self._on_refused("too many connections: the oldest is dropped")
            oldest = next(iter(self._pending))
            self._remove(oldest)
            oldest.abort()
        protocol = TimedProtocol(self._make_protocol(), self._timed, self._byte_limit(), self._remove)
        self._pending[protocol] = None
        return protocol

    def release(self, transport: asyncio.Transport) -> None:
        """Count a connection no longer: it has become a websocket, and the hub limits those."""
        protocol = transport.get_protocol()
        if isinstance(protocol, TimedProtocol):
            self._remove(protocol)

    def _byte_limit(self) -> Callable[[int], bool]:
        """Return a function that takes bytes of one connection and returns False for too many; that is logged."""
        limits = self._limits
        bucket = TokenBucket(limits.bytes_per_s, limits.bytes_burst)

        def accepts(count: int) -> bool:
            is_accepted = bucket.take(self._clock(), count)
            if not is_accepted:
                self._on_refused(f"more than {limits.bytes_per_s:g} bytes a second: the connection is dropped")
            return is_accepted

        return accepts

    def _remove(self, protocol: TimedProtocol) -> None:
        self._pending.pop(protocol, None)
