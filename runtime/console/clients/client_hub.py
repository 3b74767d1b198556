"""All clients together: who is there, who has the control, and what each is told."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final

import orjson

from runtime.console.clients.client import Client, Frame, Wire
from runtime.console.clients.control import Control, Holder
from runtime.console.http.client_limits import Limits

if TYPE_CHECKING:
    from asyncio import AbstractEventLoop

LINES_KEPT: Final = 200
"""Newest lines of the log."""
LINES_TOLD: Final = 50
"""So many of them are told to who comes later."""
TEXT_MAX: Final = 500
"""Of a value in the log; a page has no use for more."""


class Hub:
    """The clients of one run.

    Parameters
    ----------
    limits : Limits
        What they may cost.
    clock : callable
        Monotonic, s.
    left : callable
        Called when the client that had the control has it no longer.
    """

    def __init__(self, limits: Limits, clock: Callable[[], float], left: Callable[[], None]) -> None:
        self.clients: dict[int, Client] = {}
        self.control = Control(self._tell_role, lambda _client: left())
        self._limits = limits
        self._clock = clock
        self._lines: deque[bytes] = deque(maxlen=LINES_KEPT)
        self._number = 0
        self._loop: AbstractEventLoop | None = None
        self._thread = threading.get_ident()

    def bind(self, loop: AbstractEventLoop) -> None:
        """Take note of the loop that the clients live in."""
        self._loop, self._thread = loop, threading.get_ident()

    @property
    def is_full(self) -> bool:
        """Whether there may be no further client."""
        return len(self.clients) >= self._limits.clients

    def join(self, wire: Wire, address: str, hello: Mapping[str, Any], *, has_token: bool) -> Client:
        """Take a client in and greet it."""
        self._number += 1
        name = f"client {self._number} ({address})"
        client = Client(self._number, name, wire, self._limits, self._clock, has_token=has_token)
        self.clients[client.number] = client
        self.control.join(client)
        client.controls = self.control.has(client)
        self._greet(client, hello)
        for line in list(self._lines)[-LINES_TOLD:]:
            client.mention(line)
        return client

    def leave(self, client: Client) -> None:
        """Take note that a client is gone."""
        if self.clients.pop(client.number, None) is not None:
            self.control.leave(client)

    def publish(self, frame: Frame) -> None:
        """Show all who watch the run a frame of it."""
        for client in self.clients.values():
            if client.is_live:
                client.show(frame)

    def tell(self, message: Mapping[str, Any]) -> None:
        """Tell all clients the same."""
        data = orjson.dumps(message)
        for client in list(self.clients.values()):
            client.say_encoded(data)

    def greet(self, hello: Mapping[str, Any]) -> None:
        """Tell all clients what they are told first, and show them everything anew."""
        for client in list(self.clients.values()):
            self._greet(client, hello)

    @property
    def lines(self) -> bytes:
        """The newest lines of the log, JSON, a line each."""
        return b"".join(line + b"\n" for line in self._lines)

    def look_after(self, now_s: float) -> list[Client]:
        """Let those go that take nothing any more, and return them; hand the control over where it is time."""
        stalled = [client for client in self.clients.values() if client.is_stalled(now_s)]
        for client in stalled:
            client.cut()
            self.leave(client)
        self.control.expire(now_s)
        return stalled

    def on_log(self, event: Mapping[str, Any]) -> None:
        """Take a line of the log, from whichever thread."""
        if threading.get_ident() != self._thread:
            if self._loop is not None and not self._loop.is_closed():
                self._loop.call_soon_threadsafe(self.on_log, dict(event))
            return
        known = ("level", "event", "timestamp")
        fields = {name: str(value)[:TEXT_MAX] for name, value in event.items() if name not in known}
        line = {
            "type": "log",
            "timestamp": str(event.get("timestamp", "")),
            "level": str(event.get("level", "info")),
            "event": str(event.get("event", ""))[:TEXT_MAX],
            "fields": fields,
        }
        data = orjson.dumps(line)
        self._lines.append(data)
        for client in list(self.clients.values()):
            client.mention(data)

    def _greet(self, client: Client, hello: Mapping[str, Any]) -> None:
        client.begin_anew()
        client.say({**hello, "role": role_of(client), "client": client.number, "has_token": client.has_token})

    def _tell_role(self, holder: Holder, asker: Holder | None) -> None:
        client = self.clients.get(holder.number)
        if client is None:
            return
        client.controls = self.control.has(client)
        client.say(
            {
                "type": "role",
                "role": role_of(client),
                "asked_by": None if asker is None else asker.name,
                "client": None if asker is None else asker.number,
            }
        )


def role_of(client: Client) -> str:
    """Return what a client is, in the wire's words."""
    return "control" if client.controls else "watch"
