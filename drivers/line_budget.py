"""What a line may bring: whether it can carry what a robot sends, and how many bytes of a flood are read.

A line that is too slow would look like a bad cable. A device that sends valid frames far faster than a robot does
would take all the time of the cycle.
"""

from __future__ import annotations

import math
from typing import Final

from config.robot import LinkConfig
from drivers.firing_pattern import FiringError
from drivers.token_bucket import TokenBucket

BITS_PER_BYTE: Final = 10
"""With start and stop bit."""
SHARE_MAX: Final = 0.9
"""Greatest share of the line that regular traffic may take: answers and retries need the rest, and a full line delays
every stop."""
BAUDS: Final = (9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600)


def refuse_slow_line(link: LinkConfig, fixed_bytes_s: float, firing_bytes: float, step_s: float) -> None:
    """Raise an error if the line is too slow for what the robot sends.

    Besides its ranges it sends `fixed_bytes_s`, for each firing `firing_bytes`, every `step_s`.

    Raises
    ------
    FiringError
        It is too slow: the message names the speeds and the firing periods that fit.
    """
    if "://" in (link.port or ""):  # a network carries more than any line
        return
    needed, held = fixed_bytes_s + firing_bytes / step_s, link.baud / BITS_PER_BYTE
    if needed <= SHARE_MAX * held:
        return
    bauds = [baud for baud in BAUDS if needed <= SHARE_MAX * baud / BITS_PER_BYTE]
    fits = [f"link.baud to {bauds[0]} or more, here and at the robot"] if bauds else []
    if (left := SHARE_MAX * held - fixed_bytes_s) > 0.0:
        fits.append(f"ring.firing.step_period_s to {-(-1e3 * firing_bytes // left) * 1e-3:g} or more")
    remedy = (
        f"set {', or '.join(fits)}" if fits else "have the robot send odometry less often, or connect it by a network"
    )
    raise FiringError(
        f"ring.firing, link.baud: echoes and odometry are {needed:.0f} bytes a second; a line of {link.baud} baud "
        f"carries {held:.0f}, of which at most {100 * SHARE_MAX:.0f} % may be used; {remedy}"
    )


RATE_SHARE: Final = 2.0
"""Bytes that are accepted on average, as a share of what a serial line of the configured speed carries."""
NETWORK_BYTES_S: Final = 65_536.0
"""Bytes accepted from a network or gateway, byte/s: more than any robot's line, and 0.1 to 0.2 of the loop's time in
frames of the least size."""
BURST_BYTES: Final = 20_480.0
"""Bytes accepted at once: what the system's buffers hold after this process was suspended."""
FLOOD_S: Final = 1.0
"""So long after bytes were dropped the measurements are not trusted, s."""
FLOOD_HOLD_S: Final = 0.02
"""Pause before the next read of a line that brings more, s."""
FLOOD: Final = (
    "the line brings more bytes than a robot sends ({:.0f} kB dropped so far), so that measurements are missing; the "
    "robot's firmware is faulty, or another device sends on the line: restart the robot, and check what else is "
    "connected"
)


class ReceiveBudget:
    """Bounds the bytes that a driver gets from its line, so that no peer can fill the loop's time."""

    def __init__(self, link: LinkConfig) -> None:
        is_serial = "://" not in (link.port or "")
        self.dropped = 0
        """Number of bytes beyond the budget."""
        self._bucket = TokenBucket(
            RATE_SHARE * link.baud / BITS_PER_BYTE if is_serial else NETWORK_BYTES_S, BURST_BYTES
        )
        self._dropped_s = -math.inf
        """When bytes were dropped last."""

    def accepts(self, data: bytes, run_s: float) -> bool:
        """Return whether these bytes, received at `run_s`, may be read; count them as dropped if not."""
        if self._bucket.take(run_s, len(data)):
            return True
        self.dropped, self._dropped_s = self.dropped + len(data), run_s
        return False

    def flood(self, run_s: float) -> str | None:
        """Return why measurements cannot be trusted, None while no bytes are dropped."""
        return FLOOD.format(1e-3 * self.dropped) if run_s - self._dropped_s < FLOOD_S else None
