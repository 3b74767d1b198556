"""Sensors that fire together compared with the same sensors one by one: which receive the pulses of others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from config.robot import RingConfig
from drivers.firing_pattern import firing_pattern, sensors

SHORTER_MIN_M: Final = 0.05
"""Shorter than any range of the sensor by itself by this, m: what unsteady echoes do not explain."""
SHARE: Final = 0.2
"""Share of the firings from which on it is crosstalk, as of `ring_trial`'s other faults."""


def crosstalk(
    alone: Sequence[Sequence[float]], together: Sequence[Sequence[float]], ring: RingConfig
) -> dict[int, str]:
    """Return the finding about each sensor that hears others, by sensor.

    Parameters
    ----------
    alone, together : sequence of sequence of float
        Ranges of each sensor by itself, and in the robot's own pattern: m, +inf no echo.
    ring : RingConfig
        With that pattern.
    """
    found = {}
    masks = firing_pattern(ring).masks
    for sensor, (own, others) in enumerate(zip(alone, together, strict=True)):
        least_m = min(own, default=0.0)
        shorter = [value for value in others if value < least_m - max(SHORTER_MIN_M, 2.0 * ring.resolution_m)]
        if not others or len(shorter) <= SHARE * len(others):
            continue
        partners = sorted({i for mask in masks if mask >> sensor & 1 for i in sensors(mask)} - {sensor})
        alone_m = "nothing" if least_m == math.inf else f"nothing nearer than {least_m:.2f} m"
        found[sensor] = (
            f"CROSSTALK: it fires together with {', '.join(map(str, partners))} and then hears {min(shorter):.2f} m "
            f"in {len(shorter)} of {len(others)} firings, by itself {alone_m}: fire sensors that look nearly the "
            f"same way in different sets of ring.firing, 60 degrees apart or more"
        )
    return found
