"""What the robot does not say by itself: that it no longer hears, and that it restarted without a trace.

A robot that talks on may have stopped listening; then its odometry goes on naming an old DRIVE. One that restarted
just as its clock wrapped seems to carry on; but it has lost its firing pattern, so its ring is silent.
"""

from __future__ import annotations

from collections import deque

_KEPT = 128
"""DRIVEs remembered: half of the sequence numbers, so that none is mistaken for the one before it."""


class CommandAckMonitor:
    """Follows which DRIVE the odometry names, and says for how long none of the newer ones has been taken.

    A robot that names the same DRIVE all its life tells nothing by it and is not held to it: only one that has been
    seen to follow is.
    """

    def __init__(self) -> None:
        self._sent: deque[tuple[int, float]] = deque(maxlen=_KEPT)
        self._named: int | None = None
        self._follows = False

    def __contains__(self, seq: int) -> bool:
        return any(seq == sent for sent, _ in self._sent)

    def sent(self, seq: int, now_s: float) -> None:
        """Remember that a DRIVE with this number has gone on the line."""
        self._sent.append((seq, now_s))

    def named(self, seq: int) -> None:
        """Take from the odometry which DRIVE was taken last: it and those before it need no more waiting for."""
        if seq not in self:
            return
        self._follows = self._follows or self._named not in (None, seq)
        self._named = seq
        while self._sent.popleft()[0] != seq:
            pass

    def settle(self) -> None:
        """Wait no more for what has been sent: it was refused, or given up."""
        self._sent.clear()

    def untaken_s(self, heard_s: float) -> float:
        """Return for how long DRIVEs have gone and none was taken, as odometry that came at `heard_s` tells it."""
        return max(0.0, heard_s - self._sent[0][1]) if self._follows and self._sent else 0.0


class EchoTimeout:
    """Says when a ring that should fire has been silent for so long that the robot should be asked who it is."""

    def __init__(self, patience_s: float) -> None:
        self._patience_s = patience_s
        self._since_s = self._heard_s = 0.0
        self._bad = 0

    def heard(self, now_s: float, bad: int) -> None:
        """Begin to wait anew: an echo frame has come, or a pattern was set; so many broken frames came until now."""
        self._since_s = self._heard_s = now_s
        self._bad = bad

    def should_ask(self, now_s: float) -> bool:
        """Return True once after each stretch of silence."""
        if now_s - self._since_s <= self._patience_s:
            return False
        self._since_s = now_s
        return True

    def drowned(self, now_s: float, bad: int) -> int:
        """Return how many broken frames came in place of echoes; 0 while that is too soon to say."""
        return bad - self._bad if now_s - self._heard_s > self._patience_s else 0
