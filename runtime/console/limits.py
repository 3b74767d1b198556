"""Bounds on what clients may cost: messages, silence, lines in the log."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from runtime.console.forms import MESSAGE_MAX

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
    """Connections of any kind at a time; further ones are closed as they come."""
    message_bytes: int = MESSAGE_MAX
    messages_per_s: float = 200.0
    stall_s: float = 10.0
    """A client that takes nothing for so long is let go."""
    waiting: int = 256
    """Answers and lines of the log that may wait for a client, at most."""
    waiting_bytes: int = 1 << 20


class Bucket:
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


class Refusals:
    """Tells the log who was refused what, and does not let a stranger fill it.

    Parameters
    ----------
    log : structlog logger
        Told.
    clock : callable
        Monotonic, s.
    """

    def __init__(self, log: FilteringBoundLogger, clock: Callable[[], float]) -> None:
        self._log = log
        self._clock = clock
        self._bucket = Bucket(LINES_PER_S, LINES_BURST)
        self.count = 0
        """All of them, told or not."""
        self._untold = 0

    def tell(self, why: str, client: str) -> None:
        """Take note of one more."""
        self.count += 1
        if not self._bucket.take(self._clock()):
            self._untold += 1
            return
        more = {"more_before": self._untold} if self._untold else {}
        self._untold = 0
        self._log.warning("the console refused", why=why, client=client, **more)
