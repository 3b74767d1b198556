"""A long hall, by default of forty drums: more than refinement under a small budget can keep up with.

Two columns, each drum moved a little along the hall and across it, ranges with 1 % noise.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from config.units import FOOT_M
from config.world import AcousticsConfig, DrumConfig, StartConfig, WorldConfig

A_SIDE: Final = 20
RADIUS_FT: Final = 1.0
PITCH_FT: Final = 3.2
"""Distance from drum to drum along the hall; at least six inches between two stay free."""
ACROSS_FT: Final = 4.2
ALONG_MOVE_FT: Final = 0.3
ACROSS_MOVE_FT: Final = 0.4
FROM_FT: Final = -6.0
BEYOND_FT: Final = 6.0

START: Final = StartConfig(x_m=FROM_FT * FOOT_M)
ACOUSTICS: Final = AcousticsConfig(model="specular", noise_relative=0.01)
WAY_M: Final = (A_SIDE * PITCH_FT - FROM_FT + BEYOND_FT) * FOOT_M
"""Distance from the start to beyond the last drum, m."""


def long_hall(seed: int) -> WorldConfig:
    """Return the hall of forty drums; the seed determines their positions."""
    return WorldConfig(drum=tuple(long_hall_drums(seed)), start=START, acoustics=ACOUSTICS)


def long_hall_drums(seed: int, a_side: int = A_SIDE) -> list[DrumConfig]:
    """Return the drums of a hall, so many on each side; the seed determines their positions."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 4]))
    moves = rng.uniform(-1.0, 1.0, (2, a_side, 2)).tolist()
    return [
        DrumConfig(
            x_m=(1.0 + k * PITCH_FT + along * ALONG_MOVE_FT) * FOOT_M,
            y_m=side * (ACROSS_FT + across * ACROSS_MOVE_FT) * FOOT_M,
            radius_m=RADIUS_FT * FOOT_M,
        )
        for side, column in zip((1.0, -1.0), moves, strict=True)
        for k, (along, across) in enumerate(column)
    ]
