"""Whether the serial line can carry what the robot sends: its odometry and the echoes of its firing pattern."""

from __future__ import annotations

from typing import Final

from config.robot import LinkConfig
from drivers.denning.codec import encode
from drivers.denning.frames import Echo, Echo2, Odom
from drivers.denning.wire_units import WirePattern
from drivers.firing_pattern import FiringError

ODOMETRY_PERIOD_S: Final = 0.02
"""Usual time between two samples of odometry, s; what a robot really has, it says only once the line is open."""
BITS_PER_BYTE: Final = 10
"""With start and stop bit."""
SHARE_MAX: Final = 0.9
"""Greatest share of the line that regular traffic may take: acknowledgements and retries need the rest, and a full
line delays every stop."""
BAUDS: Final = (19200, 38400, 57600, 115200, 230400, 460800, 921600)


def sent_bytes_s(pattern: WirePattern, listeners: tuple[int, ...], version: int) -> float:
    """Return how much a robot sends regularly, byte/s.

    Parameters
    ----------
    pattern : WirePattern
        The firing pattern.
    listeners : tuple of int
        Mask of the sensors that listen in each step; empty where none does.
    version : int
        Of the protocol.
    """
    odometry = len(encode(Odom(1, 0x55AA55AA, 0x11AA, 0x11AA, 0x11AA, 0x11AA, 0x11, 0x11, 1, 1)))
    echoes = 0
    for step, mask in enumerate(pattern.masks):
        heard = listeners[step] if listeners else 0
        fired, all_counts = mask.bit_count(), mask.bit_count() + heard.bit_count()
        frame = Echo(1, 0x55AA55AA, step, mask, (9,) * fired)
        finer = Echo2(1, 0x55AA55AA, step, mask, heard, (0x1101,) * all_counts)
        echoes += len(encode(finer if version > 1 else frame))
    round_s = 1e-3 * pattern.step_period_ms * len(pattern.masks)
    return odometry / ODOMETRY_PERIOD_S + echoes / round_s


def refuse_overload(link: LinkConfig, pattern: WirePattern, listeners: tuple[int, ...], version: int) -> None:
    """Raise an error if the line is too slow for the traffic; it would look like a bad cable otherwise.

    Parameters
    ----------
    link : LinkConfig
        Port and speed of the line.
    pattern, listeners, version
        As of `sent_bytes_s`.

    Raises
    ------
    FiringError
        It is too slow.
    """
    if "://" in (link.port or ""):  # a network carries more than any line
        return
    needed, held = sent_bytes_s(pattern, listeners, version), link.baud / BITS_PER_BYTE
    if needed <= SHARE_MAX * held:
        return
    bauds = [baud for baud in BAUDS if needed <= SHARE_MAX * baud / BITS_PER_BYTE]
    remedy = f"set link.baud to {bauds[0]} or more, here and at the robot" if bauds else "fire less often"
    least_s = _least_step_s(link, pattern, listeners, version)
    slower = "" if least_s is None else f", or ring.firing.step_period_s to {least_s:g} or more"
    raise FiringError(
        f"ring.firing, link.baud: echoes and odometry are {needed:.0f} bytes a second; a line of {link.baud} baud "
        f"carries {held:.0f}, of which at most {100 * SHARE_MAX:.0f} % may be used; {remedy}{slower}"
    )


def _least_step_s(link: LinkConfig, pattern: WirePattern, listeners: tuple[int, ...], version: int) -> float | None:
    """Return the shortest step that the line carries, s; None where odometry alone is too much."""
    still = sent_bytes_s(pattern._replace(step_period_ms=10**9), listeners, version)
    left = SHARE_MAX * link.baud / BITS_PER_BYTE - still
    if left <= 0.0:
        return None
    echoes = (sent_bytes_s(pattern, listeners, version) - still) * pattern.step_period_ms
    return -(-echoes // left) * 1e-3
