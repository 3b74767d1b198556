"""A hall of forty drums: more than refinement under a small budget can keep up with.

Two columns of twenty, each drum moved a little along the hall and across it, ranges with 1 % noise.
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

WAY_M: Final = (A_SIDE * PITCH_FT - FROM_FT + BEYOND_FT) * FOOT_M
"""Distance from the start to beyond the last drum, m."""


def long_hall(seed: int) -> WorldConfig:
    """Return the hall; the seed determines the positions of the drums."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, 4]))
    moves = rng.uniform(-1.0, 1.0, (2, A_SIDE, 2)).tolist()
    drums = [
        DrumConfig(
            x_m=(1.0 + k * PITCH_FT + along * ALONG_MOVE_FT) * FOOT_M,
            y_m=side * (ACROSS_FT + across * ACROSS_MOVE_FT) * FOOT_M,
            radius_m=RADIUS_FT * FOOT_M,
        )
        for side, column in zip((1.0, -1.0), moves, strict=True)
        for k, (along, across) in enumerate(column)
    ]
    return WorldConfig(
        drum=tuple(drums),
        start=StartConfig(x_m=FROM_FT * FOOT_M),
        acoustics=AcousticsConfig(model="specular", noise_relative=0.01),
    )
