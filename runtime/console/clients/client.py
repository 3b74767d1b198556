"""One client: slots for the newest challenge and frame, a short queue for messages, and one task that sends them.

The cycle never waits for a client. A frame that has not been sent is replaced by the next one, the queue is bounded,
and a client that stops receiving is disconnected after a while.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Mapping
from typing import Any, Protocol

import orjson

from drivers.token_bucket import TokenBucket
from runtime.console.http.client_limits import Limits


class Frame(Protocol):
    """The state of a run or a recording at one moment, for display."""

    @property
    def source(self) -> object:
        """Identifies the sequence of frames; changes are relative to the previous frame of the same source."""

    @property
    def number(self) -> int:
        """The frame's number in its source."""

    def encode(self, *, follows: bool, dropped: int, controls: bool) -> bytes:
        """Return the frame as a message for one client.

        `follows`: it received the previous frame of this source, so segments are sent as changes. Frames were dropped
        because it was too slow. `controls`: it has control of the robot.
        """


class Transport(Protocol):
    """The connection of a client."""

    def send(self, data: bytes) -> Awaitable[None]:
        """Send a message, and wait until the peer accepts it."""

    def abort(self) -> None:
        """Drop the connection."""


class Client:
    """A page that is open in a browser.

    The number is unique in this run; the name is for operators and the log. A client without the token only watches.
    The clock is monotonic.

    Attributes
    ----------
    is_live
        Whether it is shown the run itself, not a recording.
    is_gone
        Whether it has left.
    has_control
        Whether it has control of the robot.
    task
        Runs its current asynchronous command.
    """

    def __init__(
        self,
        number: int,
        name: str,
        transport: Transport,
        limits: Limits,
        clock: Callable[[], float],
        *,
        has_token: bool,
    ) -> None:
        self.number = number
        self.name = name
        self.has_token = has_token
        self.has_control = False
        self.is_live = True
        self.is_gone = False
        self.message_bucket = TokenBucket(limits.messages_per_s, limits.messages_per_s)
        """Limits what it may send."""
        self.task: asyncio.Task[None] | None = None
        self._transport = transport
        self._limits = limits
        self._clock = clock
        self._challenge: int | None = None
        """The newest challenge that is still to be sent."""
        self._frame: Frame | None = None
        """The newest frame that is still to be sent."""
        self._last_sent: tuple[object, int] = (None, 0)
        """Source and number of the last frame sent: the next has only changes if it follows that one."""
        self._dropped = 0
        """Frames replaced before they were sent, in all."""
        self._queue: deque[bytes] = deque()
        self._queue_bytes = 0
        """Of all messages in the queue."""
        self._newest: dict[str, bytes] = {}
        """The last message of each kind of `send_newest`."""
        self._wake = asyncio.Event()
        """Set when there is something to send, or the client has gone."""
        self._sending_since_s: float | None = None
        """Since when a message waits for the system to take it; None while none does."""

    @property
    def is_busy(self) -> bool:
        """Whether an asynchronous command of this client is still running."""
        return self.task is not None and not self.task.done()

    def switch(self, *, live: bool) -> None:
        """Show the run itself from now on, or only the frames given to `show`."""
        self.is_live = live
        self._frame = None

    def forget_frames(self) -> None:
        """Send all segments with the next frame: the page discards what it has."""
        self._frame, self._last_sent = None, (None, 0)

    def show(self, frame: Frame) -> None:
        """Send a frame, in place of one that has not been sent yet."""
        if self.is_gone:
            return
        self._dropped += self._frame is not None
        self._frame = frame
        self._wake.set()

    def send(self, message: Mapping[str, Any]) -> None:
        """Queue a message."""
        self.send_encoded(orjson.dumps(message, option=orjson.OPT_SERIALIZE_DATACLASS))

    def send_encoded(self, data: bytes) -> None:
        """Queue a message in JSON; disconnect the client if its queue is full."""
        if self.is_gone:
            return
        is_full = len(self._queue) >= self._limits.queue_messages
        if is_full or self._queue_bytes + len(data) > self._limits.queue_bytes:
            self.disconnect()
            return
        self._queue.append(data)
        self._queue_bytes += len(data)
        self._wake.set()

    def send_newest(self, kind: str, data: bytes) -> None:
        """Queue a message in JSON in place of an earlier one of this kind that has not been sent yet.

        What others do must not fill this client's queue: only the newest role and parameters are of use.
        """
        earlier = self._newest.get(kind)
        if earlier is not None and earlier in self._queue:
            self._queue.remove(earlier)
            self._queue_bytes -= len(earlier)
        self._newest[kind] = data
        self.send_encoded(data)

    def send_if_room(self, data: bytes) -> None:
        """Queue a message in JSON that may be dropped; drop it if the queue is half full."""
        if len(self._queue) < self._limits.queue_messages // 2:
            self.send_encoded(data)

    def send_challenge(self, number: int) -> None:
        """Send a challenge of the server before the next frame, in place of one that has not been sent yet."""
        if self.has_token and not self.is_gone:
            self._challenge = number
            self._wake.set()

    def is_stalled(self, host_s: float) -> bool:
        """Return whether the client has received no data for longer than the limits allow."""
        since_s = self._sending_since_s
        return since_s is not None and host_s - since_s > self._limits.stall_s

    def disconnect(self) -> None:
        """Drop the connection without a closing handshake, as for a peer that does not read."""
        self.leave()
        self._transport.abort()

    def leave(self) -> None:
        """Mark the client as gone and discard what is queued for it."""
        self.is_gone = True
        self._frame = self._challenge = None
        self._queue.clear()
        self._newest.clear()
        self._queue_bytes = 0
        self._wake.set()

    async def send_all(self) -> None:
        """Send queued messages, then the newest challenge and frame, again and again until the client is gone."""
        while not self.is_gone:
            data = self._next()
            if data is None:
                self._wake.clear()
                await self._wake.wait()
                continue
            self._sending_since_s = self._clock()
            try:
                await self._transport.send(data)
            finally:
                self._sending_since_s = None

    def _next(self) -> bytes | None:
        """Remove and return what to send next: a message, else the challenge, else the frame; None without any."""
        if self._queue:
            data = self._queue.popleft()
            self._queue_bytes -= len(data)
            return data
        challenge, self._challenge = self._challenge, None
        if challenge is not None:
            return b'{"type":"challenge","number":%d}' % challenge
        frame, self._frame = self._frame, None
        if frame is None:
            return None
        follows = self._last_sent == (frame.source, frame.number - 1)
        self._last_sent = (frame.source, frame.number)
        return frame.encode(follows=follows, dropped=self._dropped, controls=self.has_control)
