"""Bounds on what clients may cost: messages, silence, lines in the log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from runtime.console.commands.messages import MESSAGE_MAX

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

LINES_PER_S: Final = 1.0
LINES_BURST: Final = 10.0


@dataclass(frozen=True, slots=True)
class Limits:
    """What one client may do, and all together."""

    clients: int = 16
    """Pages open at a time."""
    connections: int = 64
    """Connections at a time that are no websockets (yet)."""
    message_bytes: int = MESSAGE_MAX
    messages_per_s: float = 200.0
    stall_s: float = 10.0
    """A client that takes nothing for so long is let go."""
    waiting: int = 256
    """Answers and lines of the log that may wait for a client, at most."""
    waiting_bytes: int = 1 << 20


class TokenBucket:
    """So many a second, and so many at once.

    Parameters
    ----------
    rate_per_s, burst : float
        What flows in, and what it holds.
    """

    def __init__(self, rate_per_s: float, burst: float) -> None:
        self._rate_per_s = rate_per_s
        self._burst = burst
        self._level = burst
        self._since_s: float | None = None

    def take(self, now_s: float) -> bool:
        """Say whether one more is within bounds, and count it where it is."""
        if self._since_s is not None:
            self._level = min(self._burst, self._level + self._rate_per_s * max(0.0, now_s - self._since_s))
        self._since_s = now_s
        if self._level < 1.0:
            return False
        self._level -= 1.0
        return True


class ConsoleLog:
    """Tells the log who came and went, asked and was refused, and does not let anybody fill it.

    Parameters
    ----------
    log : structlog logger
        Told.
    clock : callable
        Monotonic, s.

    Attributes
    ----------
    refusals
        All refusals, told or not.
    """

    def __init__(self, log: FilteringBoundLogger, clock: Callable[[], float]) -> None:
        self._log = log
        self._clock = clock
        self._lines = {True: TokenBucket(LINES_PER_S, LINES_BURST), False: TokenBucket(LINES_PER_S, LINES_BURST)}
        self._untold = {True: 0, False: 0}
        self.refusals = 0

    def refuse(self, why: str, client: str) -> None:
        """Take note that somebody was refused something."""
        self.refusals += 1
        self._tell("the console refused", is_bad=True, why=why, client=client)

    def tell(self, event: str, client: str) -> None:
        """Take note of something that somebody did."""
        self._tell(event, is_bad=False, client=client)

    def _tell(self, event: str, *, is_bad: bool, **fields: str) -> None:
        if not self._lines[is_bad].take(self._clock()):
            self._untold[is_bad] += 1
            return
        more = {"untold_before": self._untold[is_bad]} if self._untold[is_bad] else {}
        self._untold[is_bad] = 0
        (self._log.warning if is_bad else self._log.info)(event, **fields, **more)
