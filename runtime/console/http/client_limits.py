"""Bounds on what clients may cost the run: messages, queued data, connections, lines in the log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from runtime.console.commands.messages import MESSAGE_MAX_BYTES

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

LOG_LINES_PER_S: Final = 1.0
LOG_LINES_BURST: Final = 10.0


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
    stall_s: float = 10.0
    """A client that takes nothing for this long is disconnected."""
    queue_messages: int = 256
    """Answers and lines of the log that may wait for a client."""
    queue_bytes: int = 1 << 20
    command_age_max_s: float = 1.0
    """A command that can begin a motion is refused if it arrives later: what it was decided on is out of date."""


class TokenBucket:
    """Limits a rate of events, on average and in a burst.

    Parameters
    ----------
    rate_per_s : float
        Tokens added each second.
    burst : float
        Tokens the bucket holds; it starts full.
    """

    def __init__(self, rate_per_s: float, burst: float) -> None:
        self._rate_per_s = rate_per_s
        self._burst = burst
        self._tokens = burst
        self._updated_s: float | None = None

    def take(self, host_s: float) -> bool:
        """Take a token and return True; return False if no token is left."""
        if self._updated_s is not None:
            added = self._rate_per_s * max(0.0, host_s - self._updated_s)
            self._tokens = min(self._burst, self._tokens + added)
        self._updated_s = host_s
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True


class ConsoleLog:
    """Logs what clients do and what is refused to them, at a bounded rate so that no client can flood the log.

    Parameters
    ----------
    log : structlog logger
        The run's log.
    clock : callable
        Monotonic, s.

    Attributes
    ----------
    refusals
        Number of all refusals, logged or not.
    """

    def __init__(self, log: FilteringBoundLogger, clock: Callable[[], float]) -> None:
        self._log = log
        self._clock = clock
        self._buckets = {level: TokenBucket(LOG_LINES_PER_S, LOG_LINES_BURST) for level in ("info", "warning")}
        self._suppressed = dict.fromkeys(self._buckets, 0)
        self.refusals = 0

    def refuse(self, reason: str, client: str) -> None:
        """Log that something was refused to a client."""
        self.refusals += 1
        self._write("warning", "console refused", reason=reason, client=client)

    def note(self, event: str, client: str) -> None:
        """Log what a client did."""
        self._write("info", event, client=client)

    def _write(self, level: str, event: str, **fields: str) -> None:
        if not self._buckets[level].take(self._clock()):
            self._suppressed[level] += 1
            return
        suppressed, self._suppressed[level] = self._suppressed[level], 0
        more = {"suppressed_before": suppressed} if suppressed else {}
        (self._log.warning if level == "warning" else self._log.info)(event, **fields, **more)
