"""Headings that turn steadily: what a schema chooses anew in a cycle jumps with every echo, as would the wheels."""

from __future__ import annotations

import math
from typing import Final

from perception.percept import wrap_angle

HELD_RAD: Final = math.radians(1.0)
"""The heading is not corrected by less than this, and in full by twice this: the odometry's rounding would steer the
wheels to and fro."""


def turned_towards(last_rad: float, wanted_rad: float, share: float) -> float:
    """Return the direction after a cycle's turn from the last one by a share of the angle to the wanted one, rad."""
    return last_rad + share * wrap_angle(wanted_rad - last_rad)


def held(heading_rad: float, wanted_rad: float) -> float:
    """Return the direction that is asked of a robot with this heading: its heading, where they hardly differ, rad."""
    off = wrap_angle(wanted_rad - heading_rad)
    return heading_rad + off * min(1.0, max(0.0, abs(off) / HELD_RAD - 1.0))
