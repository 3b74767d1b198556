"""What a Pioneer sends: an information packet ten times a second, with the ranges measured since the last one."""

from __future__ import annotations

from typing import Final

from drivers.arcos.sonar import DISCS_PER_ARRAY
from drivers.arcos.wire_units import Polling

SIP_BYTES: Final = 49
"""Of the longest packet without a range: with accessories, charger and the controller's clock."""
RANGE_BYTES: Final = 3
"""A disc's number, and its range."""


def traffic_of(polling: Polling, discs: tuple[int, ...]) -> tuple[float, float]:
    """Return what a firing adds to the packets, bytes, and the time from one to the next, s.

    `discs` are the robot's numbers of the ring's sensors.
    """
    arrays = len({disc // DISCS_PER_ARRAY for disc in discs})
    return float(RANGE_BYTES * arrays), 1e-3 * polling.cycle_ms
