"""Slow, readable oracle of a polygon's echoes, written with complex numbers from the acoustics.

A mirror answers from the foot of the perpendicular where that lies on a side and in the beam; without such a foot it
may answer from a corner. A cone answers from the nearest point in the beam.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass

FT = 0.3048
END_M = 0.12 * FT
GRAZING = 0.05
CORNER_PRICE = 0.7
EDGE_REACH = 1.0
EDGE_PRICE = 3.0 / FT


@dataclass(frozen=True)
class Rule:
    """An expected range, None without an answer; whether it must be heard; and the price of the answer, nat."""

    expected: float | None
    must: bool
    price: float = 0.0

    def worth(self, r: float, gate: float, miss: float, short: float, evidence: float) -> float:
        """Return what a reading adds to the sum if its error has this evidence."""
        if self.expected is None:
            return 0.0
        if abs(r - self.expected) < gate:
            return evidence - self.price if self.must else max(0.0, evidence - self.price)
        if not self.must:
            return 0.0
        return miss if r > self.expected else short


def angle_between(a: complex, b: complex) -> float:
    """Return the unsigned angle between two vectors."""
    return abs(cmath.phase(a / b))


def sides_faced(
    sensor: complex, vertices: Sequence[complex], *, closed: bool
) -> list[tuple[complex, complex, complex]]:
    """Return both ends and the outward normal of each side that faces the sensor; an open outline has no inside."""
    ends = list(zip(vertices, [*vertices[1:], vertices[0]], strict=True))
    faced = []
    for a, b in ends if closed else ends[:-1]:
        outward = -1j * (b - a) / abs(b - a)
        inside = ((sensor - a) * outward.conjugate()).real < 0.0
        if not (inside and closed):
            faced.append((a, b, -outward if inside else outward))
    return faced


def met_at(sensor: complex, ray: complex, a: complex, b: complex, outward: complex) -> float | None:
    """Return the distance along a ray to a side, None where it does not meet it."""
    towards = (ray * -outward.conjugate()).real
    if towards <= GRAZING:
        return None
    reach = ((sensor - a) * outward.conjugate()).real / towards
    place = ((sensor + reach * ray - a) * (b - a).conjugate()).real / abs(b - a)
    return reach if 0.0 <= place <= abs(b - a) else None


def predict(
    sensor: complex, axis: complex, vertices: Sequence[complex], *, closed: bool, may: float, must: float, half: float
) -> tuple[Rule, Rule]:
    """Return the echo of an outline by either rule; `may`, `must` and `half` are angles off the axis, rad."""
    faced = sides_faced(sensor, vertices, closed=closed)
    feet = []
    for a, b, outward in faced:
        place = ((sensor - a) * (b - a).conjugate()).real / abs(b - a)
        off = angle_between(-outward, axis)
        if 0.0 <= place <= abs(b - a) and off <= may:
            inner = END_M < place < abs(b - a) - END_M
            feet.append((((sensor - a) * outward.conjugate()).real, off <= must and inner))
    ring = list(vertices)

    def price(corner: complex) -> float:
        """Return the price of a corner's echo: a convex edge of a closed outline is not heard from afar."""
        i = ring.index(corner)
        bend = ((ring[(i + 1) % len(ring)] - corner) / (corner - ring[i - 1])).imag
        return CORNER_PRICE + (
            EDGE_PRICE * max(0.0, abs(corner - sensor) - EDGE_REACH) if closed and bend > 0.0 else 0.0
        )

    corners = [(abs(v - sensor), angle_between(v - sensor, axis)) for a, b, _ in faced for v in (a, b)]
    within = [d for d, off in corners if off <= may]

    def edges(opening: float) -> list[float]:
        rays = [axis * cmath.rect(1.0, turn) for turn in (opening, -opening)]
        found = [met_at(sensor, ray, a, b, outward) for a, b, outward in faced for ray in rays]
        return [d for d in found if d is not None]

    foot = min(feet, default=None)
    nearest = min((v for a, b, _ in faced for v in (a, b) if angle_between(v - sensor, axis) <= may),
                  key=lambda v: abs(v - sensor), default=None)  # fmt: skip
    corner = Rule(None if nearest is None else abs(nearest - sensor), must=False,
                  price=CORNER_PRICE if nearest is None else price(nearest))  # fmt: skip
    mirror = corner if foot is None else Rule(*foot)
    points = [d for d, _ in feet] + within + edges(half)
    well_inside = any(off <= must for _, off in corners) or bool(edges(must))
    is_certain = mirror.must or (bool(points) and well_inside)
    return mirror, Rule(min(points, default=None), must=is_certain)


def score(
    readings: Sequence[tuple[float, tuple[Rule, Rule], tuple[float, float]]], gate: float, miss: float, short: float
) -> tuple[float, list[dict[str, float]]]:
    """Return the evidence, and the counts of either rule; a reading is a range, both rules and both evidences."""
    sums = []
    for rule in (0, 1):
        total = hits = sure = throughs = near = 0.0
        for r, both, evidence in readings:
            echo = both[rule]
            value = echo.worth(r, gate, miss, short, evidence[rule])
            total += value
            if echo.expected is None:
                continue
            if abs(r - echo.expected) < gate:
                near += 1
                hits += value > 0.0
                sure += value > 0.0 and echo.must
            elif echo.must and r > echo.expected:
                throughs += 1
        surplus = throughs - 0.2 * (hits + throughs) - 1.0
        total -= 2.0 * max(0.0, surplus)
        sums.append({"llr": total, "hits": hits, "throughs": throughs, "near": near, "sure": sure})
    a, b = sums[0]["llr"], sums[1]["llr"]
    return max(a, b) + math.log(0.5 * (1.0 + math.exp(-abs(a - b)))), sums
