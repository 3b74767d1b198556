"""Slow, readable oracle of what a polygon sends back, written with complex numbers from the acoustics.

A side is heard at the foot of the perpendicular where that lies on it and in the beam: strong. A corner in the beam,
and the point where the beam's edge meets a side, may be heard: weak. Of all these the one nearest to the range
explains it, except that a weak one has to be nearer than a strong one by a margin.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass

FT = 0.3048
END_M = 0.12 * FT
PREFERENCE_M = 0.03 * FT
AGAIN_M = 0.001 * FT
EXPLAINED_M = 0.05 * FT
GRAZING = 0.05


@dataclass(frozen=True)
class Prediction:
    """Range of the nearest side that answers, whether it must, and the miss of the best explanation."""

    strong: float | None
    must: bool
    miss: float | None
    weak: bool


def angle_between(a: complex, b: complex) -> float:
    """Unsigned angle between two vectors."""
    return abs(cmath.phase(a / b))


def predict(
    sensor: complex, axis: complex, r: float, vertices: Sequence[complex], *, closed: bool, may: float, must: float,
    half: float,
) -> Prediction:  # fmt: skip
    """What is heard of an outline; `may` and `must` are angles off the axis, `half` the beam's half opening, rad."""
    ends = list(zip(vertices, [*vertices[1:], vertices[0]], strict=True))
    strong: tuple[float, bool] | None = None
    best: tuple[float, bool] | None = None

    def offer(miss: float) -> None:
        """A weak explanation."""
        nonlocal best
        margin = 0.0 if best is None else AGAIN_M if best[1] else PREFERENCE_M
        if best is None or abs(miss) + margin < abs(best[0]):
            best = (miss, True)

    for a, b in ends if closed else ends[:-1]:
        along = (b - a) / abs(b - a)
        outward = -1j * along
        height = ((sensor - a) / along).imag * -1.0
        if height < 0.0 and closed:
            continue
        if height < 0.0:
            outward = -outward
        height = abs(height)
        place = ((sensor - a) / along).real
        off = angle_between(-outward, axis)
        if off <= may and 0.0 <= place <= abs(b - a):
            if strong is None or height < strong[0]:
                strong = (height, off <= must and END_M < place < abs(b - a) - END_M)
            if best is None or abs(r - height) < abs(best[0]):
                best = (r - height, False)
        for corner in (a, b):
            if corner == sensor or angle_between(corner - sensor, axis) <= may:
                offer(r - abs(corner - sensor))
        if best is None or abs(best[0]) > EXPLAINED_M:
            for turn in (half, -half):
                ray = axis * cmath.rect(1.0, turn)
                towards = math.cos(cmath.phase(ray / -outward))
                if towards > GRAZING:
                    met = sensor + ray * height / towards
                    if 0.0 <= ((met - a) / along).real <= abs(b - a):
                        offer(r - height / towards)
    return Prediction(
        None if strong is None else strong[0], strong is not None and strong[1], None if best is None else best[0],
        best is not None and best[1],
    )  # fmt: skip
