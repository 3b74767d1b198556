"""The noise schema (Arkin 1989): a random direction that is kept for a while, to shake the robot out of a standstill.

The direction is a function of the seed and of the time, so that a replay of the same times repeats it.
"""

from __future__ import annotations

import math
from typing import Final

from behaviors.response import Response
from config.behaviors import NoiseConfig

SCHEMA: Final = "noise"

_GOLDEN: Final = 0x9E3779B97F4A7C15
_BITS: Final = (1 << 64) - 1


def noise(run_s: float, config: NoiseConfig) -> Response:
    """Return the vector at a time.

    Parameters
    ----------
    run_s
        By the run's clock, s.
    config
        Gain, persistence and seed.
    """
    heading = 2.0 * math.pi * _uniform(config.seed, math.floor(run_s / config.persistence_s))
    return Response(SCHEMA, config.noise_gain * math.cos(heading), config.noise_gain * math.sin(heading))


def _uniform(seed: int, number: int) -> float:
    """Return a number from 0 to 1, by SplitMix64 (Steele, Lea & Flood, OOPSLA 2014)."""
    mixed = (_uniform_bits(seed) + number * _GOLDEN) & _BITS
    return _uniform_bits(mixed) / 2.0**64


def _uniform_bits(value: int) -> int:
    value = (value + _GOLDEN) & _BITS
    value = ((value ^ (value >> 30)) * 0xBF58476D1CE4E5B9) & _BITS
    value = ((value ^ (value >> 27)) * 0x94D049BB133111EB) & _BITS
    return value ^ (value >> 31)
