"""Challenges of the server: a command that can begin a motion carries the newest one that its page has received.

The number and the moment of issue are the server's own, so that neither the page's clock nor the network decides how
old a command is. A late command, or one from before the robot stopped, carries an old challenge and is refused.
"""

from __future__ import annotations

import secrets
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

PERIOD_S: Final = 0.2
"""Time between challenges."""
KEPT: Final = 512
"""Challenges that are kept to say how late a command is."""
NUMBER_BITS: Final = 52
"""A page keeps numbers as 64-bit floats, which hold whole numbers of so many bits."""

ABSENT: Final = "it carries no challenge of the server, so it may be late: reload the page"
UNKNOWN: Final = "it arrived far too late and was not carried out: press again"
STOPPED: Final = "the robot was stopped after this was sent, so it was not carried out: look, then press again"


@dataclass(slots=True)
class Challenge:
    """A challenge that was issued."""

    number: int
    issued_s: float
    is_void: bool = False
    """Whether the robot has stopped since."""


class Challenges:
    """The challenges of one run.

    A command with a challenge older than `age_max_s` is refused. The clock is the host's, monotonic.

    Attributes
    ----------
    stops
        How often the robot has stopped: a command that waits for a cycle is void if this has changed.
    """

    def __init__(self, clock: Callable[[], float], age_max_s: float) -> None:
        self._clock = clock
        self._age_max_s = age_max_s
        self._issued: deque[Challenge] = deque(maxlen=KEPT)
        self.stops = 0
        self.issue()

    @property
    def newest(self) -> int:
        """The number of the newest challenge."""
        return self._issued[-1].number

    def issue(self) -> int:
        """Issue a challenge and return its number."""
        self._issued.append(Challenge(secrets.randbits(NUMBER_BITS), self._clock()))
        return self.newest

    def void_all(self) -> int:
        """Void every challenge, because the robot stops; return the number of a new one."""
        self.stops += 1
        for challenge in self._issued:
            challenge.is_void = True
        return self.issue()

    def refusal_reason(self, number: int | None, *, survives_stop: bool = False) -> str | None:
        """Return why a command with this challenge is refused, None if it is fresh.

        A command that survives a stop may have been sent before it.
        """
        if number is None:
            return ABSENT
        found = self._find(number)
        if found is None:
            return UNKNOWN
        if found.is_void and not survives_stop:
            return STOPPED
        age_s = self._clock() - found.issued_s
        return (
            f"it arrived {age_s:.1f} s late and was not carried out: press again" if age_s > self._age_max_s else None
        )

    def _find(self, number: int) -> Challenge | None:
        return next((challenge for challenge in reversed(self._issued) if challenge.number == number), None)
