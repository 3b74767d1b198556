"""Fields of view for tests of behaviours."""

from __future__ import annotations

import math

import numpy as np

from perception.percept import FieldOfView, Floats

EVERYWHERE = FieldOfView(np.zeros(1), np.zeros(1), np.zeros(1), np.zeros(1), 4.0 * math.pi, math.inf, 1e9)
"""One sensor that looks in all directions and has just done so, for ever."""


def ring_view(
    ages_s: Floats, *, half_angle_deg: float = 12.0, reach_m: float = 8.0, age_max_s: float = 1.5
) -> FieldOfView:
    """Return the view of a regular ring whose sensors looked so long ago."""
    axes = np.arange(len(ages_s)) * 2.0 * math.pi / len(ages_s)
    return FieldOfView(axes, ages_s, axes, ages_s, math.radians(half_angle_deg), reach_m, age_max_s)
