"""Where connections come in: a port to listen on, and bounds that hold before anybody has said a word.

What a connection brings is parsed in the loop, so its time is booked by name; buffers are small, so that no peer can
bring much at once, nor have much kept for it; and there are only so many connections, and so many new ones a second.
"""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from typing import Final

from config.errors import FAILED, WRONG_CALL, UserError
from config.settings import ConsoleConfig
from runtime.console.http.client_limits import TokenBucket
from runtime.console.timed_coroutine import Timed
from runtime.cycle.process import CONSOLE_RECEIVE

PORTS_TRIED: Final = 20
ANY_FREE: Final = 0
BACKLOG: Final = 16
RECEIVE_BYTES: Final = 16 * 1024
"""The system doubles it for its own books; nothing larger arrives in one piece."""
SEND_BYTES: Final = 64 * 1024
"""So much may be on its way to a client; all of it is older than the newest frame."""
NEW_PER_S: Final = 200.0
NEW_BURST: Final = 600.0
"""A page is half a hundred files."""


async def listen(config: ConsoleConfig) -> socket.socket:
    """Return a socket that listens where the settings say, or on the next port that is free.

    Raises
    ------
    UserError
        There is no such address on this machine, or no port is free.
    """
    loop = asyncio.get_running_loop()
    try:
        found = await loop.getaddrinfo(config.host, 0, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except OSError as error:
        raise UserError(
            f"console.host = {config.host!r} is no address: {error.strerror}; 127.0.0.1 is this machine alone",
            WRONG_CALL,
        ) from error
    family, _, _, _, address = found[0]
    trouble = ""
    wanted = range(config.port, min(config.port + PORTS_TRIED, 65_536)) if config.port else ()
    for port in (*wanted, ANY_FREE):
        one = socket.socket(family, socket.SOCK_STREAM)
        try:
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BYTES)
            one.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BYTES)
            one.bind((address[0], port, *address[2:]))
            one.listen(BACKLOG)
        except OSError as error:
            one.close()
            trouble = error.strerror or str(error)
            continue
        one.setblocking(False)  # noqa: FBT003 - its name says it
        return one
    raise UserError(
        f"the console cannot listen on {config.host}, port {config.port}: {trouble}; choose another console.port, "
        "or run without it (--no-console)",
        FAILED,
    )


class TimedProtocol(asyncio.Protocol):
    """Hands everything on to another protocol, and has the time it takes booked.

    Parameters
    ----------
    inner : Protocol
        Does the work.
    timed : Timed
        Books it.
    lost : callable
        Told when the connection is over.
    """

    def __init__(self, inner: asyncio.Protocol, timed: Timed, lost: Callable[[TimedProtocol], None]) -> None:
        self._inner = inner
        self._lost = lost
        self._transport: asyncio.Transport | None = None
        self._is_cut = False
        self.connection_made = timed(CONSOLE_RECEIVE, self._made)  # type: ignore[method-assign]
        self.data_received = timed(CONSOLE_RECEIVE, inner.data_received)  # type: ignore[method-assign]
        self.connection_lost = timed(CONSOLE_RECEIVE, self._over)  # type: ignore[method-assign]
        self.eof_received = inner.eof_received  # type: ignore[method-assign]
        self.pause_writing = inner.pause_writing  # type: ignore[method-assign]
        self.resume_writing = inner.resume_writing  # type: ignore[method-assign]

    def cut(self) -> None:
        """Cut the connection."""
        self._is_cut = True
        if self._transport is not None:
            self._transport.abort()

    def _made(self, transport: asyncio.BaseTransport) -> None:
        self._inner.connection_made(transport)
        if isinstance(transport, asyncio.Transport):
            self._transport = transport
        if self._is_cut:
            self.cut()

    def _over(self, error: Exception | None) -> None:
        self._lost(self)
        self._inner.connection_lost(error)


class RejectingProtocol(asyncio.Protocol):
    """Cuts a connection as soon as it is made."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Cut it."""
        if isinstance(transport, asyncio.Transport):
            transport.abort()


class ConnectionLimiter:
    """Makes the protocol of each new connection.

    There may be so many that have not become a websocket yet; a further one has the oldest of them cut, so that
    nobody keeps others out by holding connections.

    Parameters
    ----------
    inner : callable
        Makes the one that does the work.
    young_max : int
        How many there may be that are no websockets.
    timed : Timed
        Books their time.
    refused : callable
        Told why a connection is not let in, or cut.
    clock : callable
        Monotonic, s.
    """

    def __init__(
        self,
        inner: Callable[[], asyncio.Protocol],
        young_max: int,
        timed: Timed,
        refused: Callable[[str], None],
        clock: Callable[[], float],
    ) -> None:
        self._inner = inner
        self._young: dict[TimedProtocol, None] = {}
        self._young_max = young_max
        self._timed = timed
        self._refused = refused
        self._clock = clock
        self._bucket = TokenBucket(NEW_PER_S, NEW_BURST)

    def __call__(self) -> asyncio.Protocol:
        """Return the protocol of a new connection."""
        if not self._bucket.take(self._clock()):
            self._refused("there are too many new connections")
            return RejectingProtocol()
        if len(self._young) >= self._young_max:
            self._refused("there are too many connections: the oldest is cut")
            oldest = next(iter(self._young))
            self._lost(oldest)
            oldest.cut()
        one = TimedProtocol(self._inner(), self._timed, self._lost)
        self._young[one] = None
        return one

    def settle(self, transport: asyncio.Transport) -> None:
        """Take note that a connection has become a websocket; those are counted by others."""
        protocol = transport.get_protocol()
        if isinstance(protocol, TimedProtocol):
            self._lost(protocol)

    def _lost(self, one: TimedProtocol) -> None:
        self._young.pop(one, None)
