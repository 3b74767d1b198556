"""A command that wants an answer: when it goes on the line, when again, and when it is given up."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from drivers.denning.frames import HostFrame

_SEQS_KEPT = 8
"""Tries whose late answers still count; far fewer than the 256 after which numbers come again."""


@dataclass(slots=True)
class Command:
    """One command under way.

    Each try has a sequence number of its own, because the robot counts gaps in them as losses; an answer to any
    try will do, because all commands are idempotent.

    Attributes
    ----------
    build
        Makes the frame from a sequence number.
    every_s
        Time from one try to the next.
    tries_max
        Tries before it is given up; None = never.
    due
        True where it should go on the line as soon as it can.
    """

    build: Callable[[int], HostFrame]
    every_s: float
    tries_max: int | None
    due: bool = True
    tries: int = 0
    sent_s: float = 0.0
    seqs: deque[int] = field(default_factory=lambda: deque(maxlen=_SEQS_KEPT))

    def frame(self, seq: int, now_s: float) -> HostFrame:
        """Return the next try's frame, and wait for its answer from now on."""
        self.due = False
        self.tries += 1
        self.sent_s = now_s
        self.seqs.append(seq)
        return self.build(seq)

    def tick(self, now_s: float) -> bool:
        """Let time pass; return True where the last try has gone unanswered."""
        if self.due or now_s - self.sent_s < self.every_s:
            return False
        if self.tries_max is not None and self.tries >= self.tries_max:
            return True
        self.due = True
        return False
