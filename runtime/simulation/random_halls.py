"""Random irregular halls: a room with eight drums, a box, two cylinders that are no drums, and a winding path.

Recognition is evaluated on them: all different, with distractors among the drums and walls that reflect like mirrors.
Each seed gives one hall. Lengths are in feet, as for the other scenes.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from config.units import FOOT_M
from config.world import AcousticsConfig, BoxConfig, DrumConfig, PolygonConfig, StartConfig, WorldConfig

DRUM: Final = 1.0
POST: Final = 0.35
BARREL: Final = 2.2
BOX: Final = 1.45
"""Radii, ft; for a box, of the circle that it needs."""
LENGTH_MAX: Final = 26.0
STEP: Final = 0.05
"""Distance between firings, ft."""
FROM: Final = -6.5
BOX_SIDE: Final = 2.0

ACOUSTICS: Final = AcousticsConfig(
    model="specular", noise_relative=0.01, dropout=0.05, outliers=0.03, outlier_max_m=15.0 * FOOT_M
)

Placed = list[tuple[float, float, float]]


def _rows(rng: np.random.Generator) -> tuple[Placed, float]:
    """Return the objects along both sides as (x, y, radius), ft, and the end of the longer side."""
    radii_ft = np.array([DRUM] * 8 + [BOX, POST, BARREL])
    while True:
        rng.shuffle(radii_ft)
        cut = 6 if rng.random() < 0.5 else 5
        placed: Placed = []
        end = 0.0
        for side, radii in ((1.0, radii_ft[:cut]), (-1.0, radii_ft[cut:])):
            x = float(rng.uniform(-1.0, 1.5))
            for radius in radii.tolist():
                x += radius
                placed.append((x, side * (float(rng.uniform(2.6, 4.2)) + radius), radius))
                x += radius + float(rng.uniform(0.5, 2.5))
            end = max(end, x)
        if end < LENGTH_MAX:
            return placed, end


def random_hall(
    seed: int, acoustics: AcousticsConfig = ACOUSTICS
) -> tuple[WorldConfig, tuple[tuple[float, float, float], ...]]:
    """Return a hall, and the poses x, y, ring_yaw (m, rad) at which the ring fires on its path through it.

    The two cylinders that are no drums are drums of other radii there.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 2]))
    placed, end = _rows(rng)
    west, east = -8.0 - float(rng.uniform(0.0, 3.0)), end + float(rng.uniform(6.0, 10.0))
    south_west, south_east, north_east, north_west = rng.uniform(8.8, 11.0, 4).tolist()
    room = ((west, -south_west), (east, -south_east), (east, north_east), (west, north_west))
    side = BOX_SIDE * FOOT_M
    world = WorldConfig(
        drum=tuple(DrumConfig(x_m=x * FOOT_M, y_m=y * FOOT_M, radius_m=r * FOOT_M) for x, y, r in placed if r != BOX),
        box=tuple(
            BoxConfig(
                x_m=x * FOOT_M, y_m=y * FOOT_M, width_m=side, depth_m=side, angle_deg=float(rng.uniform(0.0, 90.0))
            )
            for x, y, r in placed
            if r == BOX
        ),
        polygon=(PolygonConfig(vertices_m=tuple((x * FOOT_M, y * FOOT_M) for x, y in room)),),
        start=StartConfig(x_m=FROM * FOOT_M),
        acoustics=acoustics,
    )
    swing, wave, phase = float(rng.uniform(0.3, 0.9)), float(rng.uniform(8.0, 16.0)), float(rng.uniform(0.0, 6.28))
    yaw = float(rng.uniform(-math.pi, math.pi))
    xs = np.arange(FROM, end + 3.5, STEP).tolist()
    path = tuple((x * FOOT_M, swing * math.sin(2.0 * math.pi * x / wave + phase) * FOOT_M, yaw) for x in xs)
    return world, path
