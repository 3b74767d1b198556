"""Robots whose rings have blind sides, for measurements of what they touch.

Each stands for a kind: sensors in front only, as on small kits; in front and behind; on one side; all round but few.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from config.robot import RingConfig
from config.settings import Settings

RADIUS_M: Final = 0.25
BEAM_HALF_ANGLE_DEG: Final = 15.0
"""Half the width of a beam: the beams of neighbours 20° apart overlap."""
STEP_PERIOD_S: Final = 0.04
RINGS: Final[Mapping[str, tuple[float, ...]]] = MappingProxyType({
    "front-1": (0.0,),
    "front-3": (-25.0, 0.0, 25.0),
    "front-5": (-50.0, -25.0, 0.0, 25.0, 50.0),
    "round-12": (0.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0, -150.0, -120.0, -90.0, -60.0, -30.0),
    "front-4": (-30.0, -10.0, 10.0, 30.0),
    "front-6": (-50.0, -30.0, -10.0, 10.0, 30.0, 50.0),
    "front-9": (-100.0, -75.0, -50.0, -25.0, 0.0, 25.0, 50.0, 75.0, 100.0),
    "front-back": (-30.0, -10.0, 10.0, 30.0, 150.0, 170.0, -170.0, -150.0),
    "left-6": (-30.0, -10.0, 10.0, 30.0, 60.0, 90.0),
})  # fmt: skip
"""Bearings of the sensors, degrees, counter-clockwise from the front."""


def with_ring(settings: Settings, name: str) -> Settings:
    """Return the settings of a round robot on two wheels with one of `RINGS`, its sensors on the rim, one at a time.

    Parameters
    ----------
    settings : Settings
        Those of the shipped Denning, which lends its packets, its ranges and its limits.
    name : str
        The ring.
    """
    sensors = [
        {"x_m": RADIUS_M * math.cos(math.radians(a)), "y_m": RADIUS_M * math.sin(math.radians(a)), "angle_deg": a}
        for a in RINGS[name]
    ]
    ring = RingConfig.model_validate(
        {
            "sensors": sensors, "beam_half_angle_deg": BEAM_HALF_ANGLE_DEG, "range_max_m": 5.0,
            "resolution_m": settings.ring.resolution_m, "range_min_m": settings.ring.range_min_m,
            "firing": {"preset": "single", "step_period_s": STEP_PERIOD_S},
        }
    )  # fmt: skip
    body = settings.body.model_copy(update={"radius_m": RADIUS_M, "synchro": False})
    return settings.model_copy(update={"ring": ring, "body": body})
