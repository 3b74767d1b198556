"""Supervision of faults that a robot does not report: it no longer receives, or it restarted unnoticed.

A robot that still sends may have stopped receiving; then its odometry keeps naming an old DRIVE. One that restarted
just as its clock wrapped seems to carry on; but it has lost its firing pattern, so its ring is silent.
"""

from __future__ import annotations

from collections import deque

from config.robot import LinkConfig
from drivers.denning.wire_units import WirePattern

_KEPT = 128
"""DRIVEs remembered: half of the 256 sequence numbers, so that each number identifies one of them."""
_MISSED_STEPS_MAX = 2
"""Firings that the ring may miss, beyond the longest silence of the link."""


class CommandAckMonitor:
    """Measures for how long DRIVEs have been sent and not been acknowledged by the odometry.

    Odometry names the last DRIVE that was obeyed. A robot that always names the same one does not support this and is
    not supervised; supervision starts when the named DRIVE has changed once.
    """

    def __init__(self) -> None:
        self._sent: deque[tuple[int, float]] = deque(maxlen=_KEPT)
        """Number and time of the DRIVEs that are not acknowledged."""
        self._last_seq: int | None = None
        """The one that the odometry named last."""
        self._is_supported = False
        """Whether it has ever named another one than before."""

    def __contains__(self, seq: int) -> bool:
        return any(seq == sent for sent, _ in self._sent)

    def sent(self, seq: int, run_s: float) -> None:
        """Note that a DRIVE with this sequence number has been sent."""
        self._sent.append((seq, run_s))

    def acknowledged(self, seq: int) -> None:
        """Note that the odometry names this DRIVE: it and all before it are acknowledged."""
        if seq not in self:
            return
        self._is_supported = self._is_supported or self._last_seq not in (None, seq)
        self._last_seq = seq
        while self._sent.popleft()[0] != seq:
            pass

    def forget(self) -> None:
        """Expect no acknowledgement of what has been sent: it was refused, or given up."""
        self._sent.clear()

    def unacknowledged_s(self, odometry_s: float) -> float:
        """Return the age, at the time of the last odometry, of the oldest DRIVE that it does not acknowledge, s."""
        return max(0.0, odometry_s - self._sent[0][1]) if self._is_supported and self._sent else 0.0


def echo_timeout_s(link: LinkConfig, pattern: WirePattern) -> float:
    """Return for how long a ring may be silent before the robot must identify itself again, s."""
    return link.silence_max_s + _MISSED_STEPS_MAX * 1e-3 * pattern.step_period_ms


class EchoTimeout:
    """Expires when a ring that should fire has been silent for so long that the robot may have restarted."""

    def __init__(self, timeout_s: float) -> None:
        self.timeout_s = timeout_s
        self._since_s = self._echo_s = 0.0
        """When the timeout started, and when the last echo came."""
        self._bad = 0
        """Corrupt frames before the last echo."""

    def restart(self, run_s: float, bad: int) -> None:
        """Start anew: an echo has come, or a pattern was set; `bad` corrupt frames have come so far."""
        self._since_s = self._echo_s = run_s
        self._bad = bad

    def expired(self, run_s: float) -> bool:
        """Return True once after each `timeout_s` of silence."""
        if run_s - self._since_s <= self.timeout_s:
            return False
        self._since_s = run_s
        return True

    def corrupt_frames(self, run_s: float, bad: int) -> int:
        """Return how many corrupt frames came since the last echo, of `bad` so far; 0 before the timeout."""
        return bad - self._bad if run_s - self._echo_s > self.timeout_s else 0
