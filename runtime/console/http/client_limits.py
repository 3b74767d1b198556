"""Bounds on what clients may cost the run: messages, queued data, connections, lines in the log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from drivers.token_bucket import LineLimit
from runtime.console.commands.messages import MESSAGE_MAX_BYTES

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

LOG_LINES_PER_S: Final = 1.0
LOG_LINES_BURST: Final = 10.0
OLD_PAGES_PER_S: Final = 1.0 / 600.0
"""Lines about pages with a wrong token: a page of an earlier run that was left open asks again for hours."""


@dataclass(frozen=True, slots=True)
class Limits:
    """The limits of one client, and of all clients together."""

    clients: int = 16
    """Pages open at a time."""
    connections: int = 64
    """Connections at a time that are not websockets, or not yet."""
    message_bytes: int = MESSAGE_MAX_BYTES
    messages_per_s: float = 200.0
    """Ten times what a page sends while it teleoperates the robot."""
    joins_per_s: float = 4.0
    """New websockets, in a burst as many as there may be clients: each begins with the messages of a second."""
    bytes_per_s: float = 65_536.0
    """Of one connection, in whatever frames; a page sends a fiftieth of it."""
    bytes_burst: float = 1_048_576.0
    """A page that edits the map sends a tenth of it at once."""
    loop_share: float = 0.2
    """The messages of all clients together take at most this share of the loop's time."""
    stall_s: float = 10.0
    """A client that takes nothing for this long is disconnected."""
    queue_messages: int = 256
    """Answers and lines of the log that may wait for a client."""
    queue_bytes: int = 1 << 20
    command_age_max_s: float = 1.0
    """A command that can begin a motion is refused if it arrives later: what it was decided on is out of date."""


class ConsoleLog:
    """Logs what clients do and what is refused to them, at a bounded rate so that no client can flood the log.

    The clock is monotonic.

    Attributes
    ----------
    refusals
        Number of all refusals, logged or not.
    """

    def __init__(self, log: FilteringBoundLogger, clock: Callable[[], float]) -> None:
        self._log = log
        self._clock = clock
        self._limits: dict[str, LineLimit] = {}
        """By event, of which there are few."""
        self._old_pages = LineLimit(OLD_PAGES_PER_S, 1.0)
        self.refusals = 0

    def answer_refusal(self, reason: str, client: str) -> None:
        """Log that a command was refused with an answer: its operator knows, so it is no warning."""
        self.refusals += 1
        self._write("info", "console refused", self._limit("answered"), reason=reason, client=client)

    def refuse_token(self, reason: str, client: str) -> None:
        """Log that a page has a wrong token, or none."""
        self.refusals += 1
        self._write("warning", "console refused", self._old_pages, reason=reason, client=client)

    def refuse(self, reason: str, client: str) -> None:
        """Log that something was refused to a client."""
        self.refusals += 1
        self._write("warning", "console refused", self._limit("console refused"), reason=reason, client=client)

    def note(self, event: str, **fields: object) -> None:
        """Log what a client did."""
        self._write("info", event, self._limit(event), **fields)

    def _limit(self, event: str) -> LineLimit:
        return self._limits.setdefault(event, LineLimit(LOG_LINES_PER_S, LOG_LINES_BURST))

    def _write(self, level: str, event: str, limit: LineLimit, **fields: object) -> None:
        """Write a line unless its limit is reached; the next one that is written says how many were not."""
        suppressed = limit.take(self._clock())
        if suppressed is None:
            return
        more = {"suppressed_before": suppressed} if suppressed else {}
        (self._log.warning if level == "warning" else self._log.info)(event, **fields, **more)
