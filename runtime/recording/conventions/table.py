"""A ring log's numbers as arrays, and what its units and headings may mean."""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.units import FOOT_M
from drivers.messages import Floats

ANGLES: Final = MappingProxyType[str, float]({"rad": 1.0, "deg": math.pi / 180.0})
TIMES: Final = MappingProxyType[str, float](
    {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86400.0}
)
LENGTHS: Final = MappingProxyType[str, float]({"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": FOOT_M})


class HeadingRule(NamedTuple):
    """How theta and y are counted: in the file's frame, the robot looks along ``turn · theta + offset_rad``."""

    turn: int
    offset_rad: float
    hand: int
    """−1 where the file's y axis points to the right of its x axis."""
    words: str

    def angles(self, angles: Floats) -> Floats:
        """Return the file's angles (rad) as counter-clockwise from x."""
        return self.hand * (self.turn * angles + self.offset_rad)


_DOWN: Final = "y points to the right of x, and theta is"

HEADINGS: Final = MappingProxyType[str, HeadingRule](
    {
        "ccw": HeadingRule(1, 0.0, 1, "theta is counter-clockwise from x"),
        "cw": HeadingRule(-1, 0.0, 1, "theta is clockwise from x"),
        "north-cw": HeadingRule(-1, 0.5 * math.pi, 1, "theta is clockwise from y, as a compass counts"),
        "north-ccw": HeadingRule(1, 0.5 * math.pi, 1, "theta is counter-clockwise from y"),
        "y-down": HeadingRule(-1, 0.0, -1, "y points to the right of x, and theta is counter-clockwise"),
        "left-handed": HeadingRule(1, 0.0, -1, "y points to the right of x, and theta turns from x to y"),
        "west-ccw": HeadingRule(1, math.pi, 1, "theta is counter-clockwise from -x"),
        "west-cw": HeadingRule(-1, math.pi, 1, "theta is clockwise from -x"),
        "south-ccw": HeadingRule(1, -0.5 * math.pi, 1, "theta is counter-clockwise from -y"),
        "south-cw": HeadingRule(-1, -0.5 * math.pi, 1, "theta is clockwise from -y"),
        "y-down-north-ccw": HeadingRule(-1, -0.5 * math.pi, -1, f"{_DOWN} counter-clockwise from -y"),
        "y-down-north-cw": HeadingRule(1, -0.5 * math.pi, -1, f"{_DOWN} clockwise from -y"),
        "y-down-west-ccw": HeadingRule(-1, math.pi, -1, f"{_DOWN} counter-clockwise from -x"),
        "y-down-west-cw": HeadingRule(1, math.pi, -1, f"{_DOWN} clockwise from -x"),
        "y-down-south-ccw": HeadingRule(-1, 0.5 * math.pi, -1, f"{_DOWN} counter-clockwise from y"),
        "y-down-south-cw": HeadingRule(1, 0.5 * math.pi, -1, f"{_DOWN} clockwise from y"),
    }
)


class Table(NamedTuple):
    """The first part of a ring log, as arrays."""

    t: Floats
    """(n,)"""
    pose: Floats
    """(n, 4): x, y, theta, ring_yaw."""
    ranges: Floats
    """(n, sensors): NaN did not fire, inf heard nothing; −inf where the file has the text nan."""

    @property
    def moved(self) -> NDArray[np.bool_]:
        """The rows at another pose than the row before, the first one included, shape (n,)."""
        moved = np.ones(len(self.pose), dtype=np.bool_)
        moved[1:] = (np.diff(self.pose, axis=0) != 0.0).any(axis=1)
        return moved
