"""Whether a serial line can carry what a robot sends; one that is too slow would look like a bad cable."""

from __future__ import annotations

from typing import Final

from config.robot import LinkConfig
from drivers.firing_pattern import FiringError

BITS_PER_BYTE: Final = 10
"""With start and stop bit."""
SHARE_MAX: Final = 0.9
"""Greatest share of the line that regular traffic may take: answers and retries need the rest, and a full line delays
every stop."""
BAUDS: Final = (9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600)


def refuse_slow_line(link: LinkConfig, fixed_bytes_s: float, firing_bytes: float, step_s: float) -> None:
    """Raise an error if the line is too slow for what the robot sends.

    Parameters
    ----------
    link : LinkConfig
        Port and speed of the line.
    fixed_bytes_s : float
        What the robot sends besides its ranges, byte/s.
    firing_bytes : float
        What it sends for a firing, bytes.
    step_s : float
        Time from one firing to the next, s.

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
    remedy = f"set link.baud to {bauds[0]} or more, here and at the robot" if bauds else "fire less often"
    left = SHARE_MAX * held - fixed_bytes_s
    slower = (
        f", or ring.firing.step_period_s to {-(-1e3 * firing_bytes // left) * 1e-3:g} or more" if left > 0 else ""
    )
    raise FiringError(
        f"ring.firing, link.baud: echoes and odometry are {needed:.0f} bytes a second; a line of {link.baud} baud "
        f"carries {held:.0f}, of which at most {100 * SHARE_MAX:.0f} % may be used; {remedy}{slower}"
    )
