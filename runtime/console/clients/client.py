"""One client: a slot for the newest frame, a short queue for what must not be lost, and one task that sends.

Nobody ever waits for a client. A frame that it has not taken is replaced by the next one; what is queued is bounded;
and one that takes nothing at all for a while is let go.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable
from typing import Any, Protocol

import orjson

from runtime.console.http.client_limits import Limits, TokenBucket


class Frame(Protocol):
    """A moment of a run, or of a recording, as it is shown."""

    @property
    def source(self) -> object:
        """Whose frames these are; changes count from the one before of the same source."""

    @property
    def number(self) -> int:
        """Its place among them."""

    def encode(self, *, follows: bool, dropped: int, controls: bool) -> bytes:
        """Return the frame for one client: its changes only where it follows what that one saw last."""


class Wire(Protocol):
    """The connection of a client."""

    def send(self, data: bytes) -> Awaitable[None]:
        """Put a message on the way, and wait for as long as the other end takes nothing."""

    def abort(self) -> None:
        """Cut the connection."""


class Client:
    """A page that is open somewhere.

    Parameters
    ----------
    number : int
        Its own among all of this run.
    name : str
        For people.
    has_token : bool
        Whether it may do more than watch.
    wire : Wire
        The connection.
    limits : Limits
        What it may cost.
    clock : callable
        Monotonic, s.

    Attributes
    ----------
    is_live
        Whether it watches the run itself, and not a recording of its own choice.
    """

    def __init__(
        self, number: int, name: str, wire: Wire, limits: Limits, clock: Callable[[], float], *, has_token: bool
    ) -> None:
        self.number = number
        self.name = name
        self.has_token = has_token
        self.controls = False
        self.is_live = True
        self.is_gone = False
        self.bucket = TokenBucket(limits.messages_per_s, limits.messages_per_s)
        self.task: asyncio.Task[None] | None = None
        """Does what it asked for that takes its time; one thing at once."""
        self._wire = wire
        self._limits = limits
        self._clock = clock
        self._slot: Frame | None = None
        self._seen: tuple[object, int] = (None, 0)
        self._dropped = 0
        self._waiting: deque[bytes] = deque()
        self._waiting_bytes = 0
        self._wake = asyncio.Event()
        self._sending_since_s: float | None = None

    @property
    def is_busy(self) -> bool:
        """Whether something that it asked for is still under way."""
        return self.task is not None and not self.task.done()

    def switch(self, *, live: bool) -> None:
        """Have it shown the run itself, or only what `show` gives it."""
        self.is_live = live
        self._slot = None

    def begin_anew(self) -> None:
        """Take note that it forgets all that it was shown: the next frame is a whole one."""
        self._slot, self._seen = None, (None, 0)

    def show(self, frame: Frame) -> None:
        """Have a frame ready for it, in place of one it has not taken yet."""
        if self.is_gone:
            return
        self._dropped += self._slot is not None
        self._slot = frame
        self._wake.set()

    def say(self, message: dict[str, Any]) -> None:
        """Send it a message of its own."""
        self.say_encoded(orjson.dumps(message, option=orjson.OPT_SERIALIZE_DATACLASS))

    def say_encoded(self, data: bytes) -> None:
        """Send it a message; it is let go where too many wait for it already."""
        if self.is_gone:
            return
        full = len(self._waiting) >= self._limits.waiting
        if full or self._waiting_bytes + len(data) > self._limits.waiting_bytes:
            self.cut()
            return
        self._waiting.append(data)
        self._waiting_bytes += len(data)
        self._wake.set()

    def mention(self, data: bytes) -> None:
        """Send it a message that may be lost where many wait already."""
        if len(self._waiting) < self._limits.waiting // 2:
            self.say_encoded(data)

    def is_stalled(self, now_s: float) -> bool:
        """Say whether it has taken nothing for too long."""
        since_s = self._sending_since_s
        return since_s is not None and now_s - since_s > self._limits.stall_s

    def cut(self) -> None:
        """Let it go without a word, as one that does not listen."""
        self.leave()
        self._wire.abort()

    def leave(self) -> None:
        """Take note that it is gone: nothing is kept for it any more."""
        self.is_gone = True
        self._slot = None
        self._waiting.clear()
        self._waiting_bytes = 0
        self._wake.set()

    async def send_all(self) -> None:
        """Send what there is, until it is gone; messages of its own before frames."""
        while not self.is_gone:
            data = self._next()
            if data is None:
                self._wake.clear()
                await self._wake.wait()
                continue
            self._sending_since_s = self._clock()
            try:
                await self._wire.send(data)
            finally:
                self._sending_since_s = None

    def _next(self) -> bytes | None:
        if self._waiting:
            data = self._waiting.popleft()
            self._waiting_bytes -= len(data)
            return data
        frame, self._slot = self._slot, None
        if frame is None:
            return None
        follows = self._seen == (frame.source, frame.number - 1)
        self._seen = (frame.source, frame.number)
        return frame.encode(follows=follows, dropped=self._dropped, controls=self.controls)
