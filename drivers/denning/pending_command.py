"""A command that must be answered: when to send it, when to send it again, and when to give up."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from config.robot import LinkConfig
from drivers.denning.frames import Halt, Hello, HostFrame, Listen, Pattern, Release, Scan, Sweep
from drivers.denning.wire_units import WirePattern

_HELLO_PERIOD_S = 0.5
"""Time between HELLOs to a robot that does not answer or is the wrong one, s: seldom enough not to disturb it."""
_SEQS_KEPT = 8
"""Tries whose late answers still count; far fewer than the 256 after which sequence numbers repeat."""


@dataclass(slots=True)
class PendingCommand:
    """One command that has not been answered.

    Each try has its own sequence number, because the robot counts gaps in them as losses. An answer to any try
    counts, because all commands are idempotent.
    """

    build: Callable[[int], HostFrame]
    """Makes the frame from a sequence number."""
    every_s: float
    """Time from one try to the next."""
    tries_max: int | None
    """Tries before giving up; None = never."""
    due: bool = True
    """True if it should be sent as soon as possible."""
    tries: int = 0
    sent_s: float = 0.0
    """When the newest try was sent."""
    first_s: float = 0.0
    """When the first was."""
    seqs: deque[int] = field(default_factory=lambda: deque(maxlen=_SEQS_KEPT))

    def frame(self, seq: int, run_s: float) -> HostFrame:
        """Return the frame of the next try, and start waiting for its answer."""
        self.due = False
        self.tries += 1
        self.sent_s = run_s
        if self.tries == 1:
            self.first_s = run_s
        self.seqs.append(seq)
        return self.build(seq)

    def tick(self, run_s: float) -> bool:
        """Let time pass; return True if the last try stayed unanswered."""
        if self.due or run_s - self.sent_s < self.every_s:
            return False
        if self.tries_max is not None and self.tries >= self.tries_max:
            return True
        self.due = True
        return False


def pending_command(
    name: str,
    pattern: WirePattern,
    link: LinkConfig,
    version: int,
    *,
    without_limit: bool,
    listeners: tuple[int, ...] = (),
    sweeps: tuple[Sweep, ...] = (),
) -> PendingCommand:
    """Return the command of a name, not yet sent.

    Parameters
    ----------
    name : str
        HALT, RELEASE, HELLO, PATTERN, LISTEN or SCAN.
    pattern : WirePattern
        The firing pattern that PATTERN sets.
    link : LinkConfig
        Gives the time between tries and their number.
    version : int
        The version of the protocol that HELLO asks for.
    without_limit : bool
        Never give up; for a robot that does not answer anyway.
    listeners : tuple of int
        The masks that LISTEN sets, one for each step of the pattern.
    sweeps : tuple of Sweep
        The scans that SCAN sets.
    """
    tries_max = None if without_limit else link.tries
    match name:
        case "HALT":
            return PendingCommand(Halt, link.reply_timeout_s, tries_max)
        case "RELEASE":
            return PendingCommand(Release, link.reply_timeout_s, tries_max)
        case "HELLO":
            every_s = _HELLO_PERIOD_S if without_limit else link.reply_timeout_s
            return PendingCommand(lambda seq: Hello(seq, version), every_s, tries_max)
        case "LISTEN":
            return PendingCommand(lambda seq: Listen(seq, listeners), link.reply_timeout_s, tries_max)
        case "SCAN":
            return PendingCommand(lambda seq: Scan(seq, sweeps), link.reply_timeout_s, tries_max)
        case _:
            return PendingCommand(lambda seq: Pattern(seq, *pattern), link.reply_timeout_s, tries_max)
