"""Slow, readable oracle of what a polygon sends back, written with complex numbers from the acoustics.

A mirror answers from the foot of the perpendicular where that lies on a side and in the beam, and may answer from a
corner where there is none. A cone answers from the nearest point in the beam, whatever it is.
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
    """A range, if there is an answer; whether it must be heard; and what it costs, nat."""

    expected: float | None
    must: bool
    price: float = 0.0

    def worth(self, r: float, gate: float, miss: float, short: float, evidence: float) -> float:
        """What a reading counts whose error has that evidence."""
        if self.expected is None:
            return 0.0
        if abs(r - self.expected) < gate:
            return evidence - self.price if self.must else max(0.0, evidence - self.price)
        if not self.must:
            return 0.0
        return miss if r > self.expected else short


def angle_between(a: complex, b: complex) -> float:
    """Unsigned angle between two vectors."""
    return abs(cmath.phase(a / b))


def sides_faced(
    sensor: complex, vertices: Sequence[complex], *, closed: bool
) -> list[tuple[complex, complex, complex]]:
    """Both ends and the outward normal of each side one faces; an open outline has no inside."""
    ends = list(zip(vertices, [*vertices[1:], vertices[0]], strict=True))
    faced = []
    for a, b in ends if closed else ends[:-1]:
        outward = -1j * (b - a) / abs(b - a)
        inside = ((sensor - a) * outward.conjugate()).real < 0.0
        if not (inside and closed):
            faced.append((a, b, -outward if inside else outward))
    return faced


def met_at(sensor: complex, ray: complex, a: complex, b: complex, outward: complex) -> float | None:
    """How far a ray goes to a side."""
    towards = (ray * -outward.conjugate()).real
    if towards <= GRAZING:
        return None
    reach = ((sensor - a) * outward.conjugate()).real / towards
    place = ((sensor + reach * ray - a) * (b - a).conjugate()).real / abs(b - a)
    return reach if 0.0 <= place <= abs(b - a) else None


def predict(
    sensor: complex, axis: complex, vertices: Sequence[complex], *, closed: bool, may: float, must: float, half: float
) -> tuple[Rule, Rule]:
    """What is heard of an outline by either rule; `may`, `must` and `half` are angles off the axis, rad."""
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
        """A convex edge is weak, and from afar not heard; an open outline's has no inside to be convex to."""
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
    """Evidence, and the counts of either rule; readings as range, both rules and the evidence of both errors."""
    sums = []
    for rule in (0, 1):
        total = hits = sure = throughs = near = 0.0
        for r, both, evidence in readings:
            said = both[rule]
            value = said.worth(r, gate, miss, short, evidence[rule])
            total += value
            if said.expected is None:
                continue
            if abs(r - said.expected) < gate:
                near += 1
                hits += value > 0.0
                sure += value > 0.0 and said.must
            elif said.must and r > said.expected:
                throughs += 1
        surplus = throughs - 0.2 * (hits + throughs) - 1.0
        total -= 2.0 * max(0.0, surplus)
        sums.append({"llr": total, "hits": hits, "throughs": throughs, "near": near, "sure": sure})
    a, b = sums[0]["llr"], sums[1]["llr"]
    return max(a, b) + math.log(0.5 * (1.0 + math.exp(-abs(a - b)))), sums
