"""The client hub: all connected clients of a run, control of the robot, and messages to all clients."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Final

import orjson

from runtime.console.clients.challenges import Challenges
from runtime.console.clients.client import Client, Frame, Transport
from runtime.console.clients.control import Control, Holder
from runtime.console.http.client_limits import Limits
from runtime.console.sent_messages import ClientRow, LogMessage, Role, RoleMessage
from runtime.support.log_sentence import field_text

if TYPE_CHECKING:
    from asyncio import AbstractEventLoop

LOG_LINES_KEPT: Final = 200
"""The newest lines of the log, for `/log`."""
LOG_LINES_SENT: Final = 50
"""How many of them a new client is sent."""
TEXT_MAX: Final = 500
"""Characters of a value in the log; a page has no use for more."""


class ClientHub:
    """The clients of one run.

    The clock is monotonic; `on_control_lost` gets the client that had control, which has left or lost it.

    Attributes
    ----------
    clients
        Every connected client by its number.
    control
        Which of them has control of the robot.
    challenges
        Those that their commands carry.
    """

    def __init__(self, limits: Limits, clock: Callable[[], float], on_control_lost: Callable[[Holder], None]) -> None:
        self.clients: dict[int, Client] = {}
        self.control = Control(self._send_role, on_control_lost)
        self.challenges = Challenges(clock, limits.command_age_max_s)
        self._limits = limits
        self._clock = clock
        self._log_lines: deque[bytes] = deque(maxlen=LOG_LINES_KEPT)
        """The newest, in JSON, for pages that are opened later."""
        self._number = 0
        """Number of the last client."""
        self._loop: AbstractEventLoop | None = None
        self._thread = threading.get_ident()
        """The thread of the loop; lines of the log from others are passed on to it."""

    def bind(self, loop: AbstractEventLoop) -> None:
        """Use this loop for log lines that come from other threads."""
        self._loop, self._thread = loop, threading.get_ident()

    @property
    def is_full(self) -> bool:
        """Whether no further client may join."""
        return len(self.clients) >= self._limits.clients

    @property
    def log_lines(self) -> bytes:
        """The newest lines of the log in JSON, one a line."""
        return b"".join(line + b"\n" for line in self._log_lines)

    def join(self, transport: Transport, address: str, session: Mapping[str, Any], *, has_token: bool) -> Client:
        """Add a client and send it the session information; return it.

        The address is that of its peer. Without the token it only watches.
        """
        self._number += 1
        name = f"client {self._number} ({address})"
        client = Client(self._number, name, transport, self._limits, self._clock, has_token=has_token)
        self.clients[client.number] = client
        self.control.join(client)
        client.has_control = self.control.is_held_by(client)
        self._begin_session(client, session)
        for line in list(self._log_lines)[-LOG_LINES_SENT:]:
            client.send_if_room(line)
        # Challenges are issued only while there are clients.
        client.send_challenge(self.challenges.newest if len(self.clients) > 1 else self.challenges.issue())
        return client

    def leave(self, client: Client) -> None:
        """Remove a disconnected client."""
        if self.clients.pop(client.number, None) is not None:
            self.control.leave(client)

    def publish(self, frame: Frame) -> None:
        """Show a frame of the run to every client that watches the run itself."""
        for client in self.clients.values():
            if client.is_live:
                client.show(frame)

    def inform_viewers(self, status: Mapping[str, Any]) -> None:
        """Send the state of the robot to every client that watches a recording, whose frames do not show it."""
        if all(client.is_live for client in self.clients.values()):
            return
        data = orjson.dumps({"type": "robot", **status})
        for client in list(self.clients.values()):
            if not client.is_live:
                client.send_newest("robot", data)

    def issue_challenge(self) -> None:
        """Send every client a new challenge."""
        if self.clients:
            self._send_challenge(self.challenges.issue())

    def void_challenges(self) -> None:
        """Void every challenge, because the robot stops, and send every client a new one."""
        self._send_challenge(self.challenges.void_all())

    def broadcast(self, message: Mapping[str, Any]) -> None:
        """Send every client the same message, of which only the newest of its type is of use."""
        data = orjson.dumps(message)
        for client in list(self.clients.values()):
            client.send_newest(message["type"], data)

    def begin_session(self, session: Mapping[str, Any]) -> None:
        """Send every client new session information, and with its next frame all segments."""
        for client in list(self.clients.values()):
            self._begin_session(client, session)

    def disconnect_stalled(self, host_s: float) -> list[Client]:
        """Disconnect and return the clients that no longer receive; hand control over if a request is due."""
        stalled = [client for client in self.clients.values() if client.is_stalled(host_s)]
        for client in stalled:
            client.disconnect()
            self.leave(client)
        self.control.expire(host_s)
        return stalled

    def on_log(self, event: Mapping[str, Any]) -> None:
        """Send a line of the log to every client; may be called from any thread."""
        if threading.get_ident() != self._thread:
            if self._loop is not None and not self._loop.is_closed():
                self._loop.call_soon_threadsafe(self.on_log, dict(event))
            return
        known = ("level", "event", "timestamp")
        fields = {name: field_text(value)[:TEXT_MAX] for name, value in event.items() if name not in known}
        line: LogMessage = {
            "type": "log",
            "timestamp": str(event.get("timestamp", "")),
            "level": str(event.get("level", "info")),
            "event": str(event.get("event", ""))[:TEXT_MAX],
            "fields": fields,
        }
        data = orjson.dumps(line)
        self._log_lines.append(data)
        for client in list(self.clients.values()):
            client.send_if_room(data)

    def _send_challenge(self, number: int) -> None:
        for client in self.clients.values():
            client.send_challenge(number)

    def _begin_session(self, client: Client, session: Mapping[str, Any]) -> None:
        """Send a client the session information, with its own part of it; its next frame has everything."""
        client.forget_frames()
        own: ClientRow = {"role": role_of(client), "client": client.number, "has_token": client.has_token}
        client.send({**session, **own})

    def _send_role(self, holder: Holder, requester: Holder | None) -> None:
        """Send the client that a holder stands for its role, and who asks it for control."""
        client = self.clients.get(holder.number)
        if client is None:
            return
        client.has_control = self.control.is_held_by(client)
        role: RoleMessage = {
            "type": "role",
            "role": role_of(client),
            "asked_by": None if requester is None else requester.name,
            "client": None if requester is None else requester.number,
        }
        client.send_newest("role", orjson.dumps(role))


def role_of(client: Client) -> Role:
    """Return a client's role in the wire's words: "control" or "watch"."""
    return "control" if client.has_control else "watch"
