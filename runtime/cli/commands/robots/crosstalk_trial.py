"""Sensors that fire together compared with the same sensors one by one: which receive the pulses of others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from config.robot import RingConfig
from drivers.firing_pattern import firing_pattern, sensors
from runtime.cli.commands.robots.sensor_trial import REPEATS_MIN, UNSTEADY_M

SHORTER_MIN_M: Final = 0.05
"""Shorter than any range of the sensor by itself by this, m: what unsteady echoes do not explain."""
SHARE: Final = 0.2
"""Share of the firings from which on it is crosstalk, as of `ring_trial`'s other faults."""
CHANCE_MAX: Final = 0.01
"""Unsteady echoes are now and then shorter in one trial than ever in the other; crosstalk is what they are with at
most this chance."""


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
        if not _is_steady(own) and _chance(len(shorter), len(own), len(others)) > CHANCE_MAX:
            continue
        partners = sorted({i for mask in masks if mask >> sensor & 1 for i in sensors(mask)} - {sensor})
        alone_m = "nothing" if least_m == math.inf else f"nothing nearer than {least_m:.2f} m"
        found[sensor] = (
            f"CROSSTALK: it fires together with {', '.join(map(str, partners))} and then hears {min(shorter):.2f} m "
            f"in {len(shorter)} of {len(others)} firings, by itself {alone_m}: fire sensors that look nearly the "
            f"same way in different sets of ring.firing, 60 degrees apart or more"
        )
    return found


def _is_steady(ranges: Sequence[float]) -> bool:
    """Return whether a sensor reports the same again and again, an echo or none; few ranges do not show that."""
    return len(ranges) >= REPEATS_MIN and (min(ranges) == math.inf or max(ranges) - min(ranges) <= UNSTEADY_M)


def _chance(shortest: int, own: int, others: int) -> float:
    """Return the chance that so many shortest ranges of both trials all lie in the second, if both are alike.

    Parameters
    ----------
    shortest
        How many ranges of the second trial are shorter than all of the first.
    own, others
        Ranges of the first trial and of the second.
    """
    return math.comb(others, shortest) / math.comb(own + others, shortest)
