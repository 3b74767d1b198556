"""Where connections come in: a port to listen on, and bounds that hold before anybody has said a word.

What a connection brings is parsed in the loop, so its time is booked by name; buffers are small, so that no peer can
bring much at once, nor have much kept for it; and there are only so many connections, and so many new ones a second.
"""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from typing import Final

from config.settings import ConsoleConfig
from runtime.complaint import FAILED, WRONG_CALL, Complaint
from runtime.console.limits import Bucket
from runtime.console.stepped import Timed
from runtime.process import CONSOLE_RECEIVE

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
    Complaint
        There is no such address on this machine, or no port is free.
    """
    loop = asyncio.get_running_loop()
    try:
        found = await loop.getaddrinfo(config.host, 0, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    except OSError as error:
        raise Complaint(
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
    raise Complaint(
        f"the console cannot listen on {config.host}, port {config.port}: {trouble}; choose another console.port, "
        "or run without it (--no-console)",
        FAILED,
    )


class Timely(asyncio.Protocol):
    """Hands everything on to another protocol, and has the time it takes booked.

    Parameters
    ----------
    inner : Protocol
        Does the work.
    timed : Timed
        Books it.
    lost : callable
        Called when the connection is over.
    """

    def __init__(self, inner: asyncio.Protocol, timed: Timed, lost: Callable[[], None]) -> None:
        def connection_lost(error: Exception | None) -> None:
            lost()
            inner.connection_lost(error)

        self.connection_made = timed(CONSOLE_RECEIVE, inner.connection_made)  # type: ignore[method-assign]
        self.data_received = timed(CONSOLE_RECEIVE, inner.data_received)  # type: ignore[method-assign]
        self.connection_lost = timed(CONSOLE_RECEIVE, connection_lost)  # type: ignore[method-assign]
        self.eof_received = inner.eof_received  # type: ignore[method-assign]
        self.pause_writing = inner.pause_writing  # type: ignore[method-assign]
        self.resume_writing = inner.resume_writing  # type: ignore[method-assign]


class Shut(asyncio.Protocol):
    """Closes a connection as soon as it is made."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Close it."""
        if isinstance(transport, asyncio.Transport):
            transport.abort()


class Door:
    """Makes the protocol of each new connection.

    Parameters
    ----------
    inner : callable
        Makes the one that does the work.
    connections_max : int
        How many connections there may be at a time.
    timed : Timed
        Books their time.
    refused : callable
        Told of a connection that is not let in, and why.
    clock : callable
        Monotonic, s.
    """

    def __init__(
        self,
        inner: Callable[[], asyncio.Protocol],
        connections_max: int,
        timed: Timed,
        refused: Callable[[str], None],
        clock: Callable[[], float],
    ) -> None:
        self._inner = inner
        self._connections = 0
        self._connections_max = connections_max
        self._timed = timed
        self._refused = refused
        self._clock = clock
        self._bucket = Bucket(NEW_PER_S, NEW_BURST)

    def __call__(self) -> asyncio.Protocol:
        """Return the protocol of a new connection."""
        if self._connections >= self._connections_max:
            self._refused(f"there are {self._connections_max} connections already")
        elif not self._bucket.take(self._clock()):
            self._refused("there are too many new connections")
        else:
            self._connections += 1
            return Timely(self._inner(), self._timed, self._lost)
        return Shut()

    def _lost(self) -> None:
        self._connections -= 1
