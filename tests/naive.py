"""Slow, readable oracles of the kernels: plain Python, no numba, written from the paper and not from the kernels.

Each says the same as its kernel in the shortest words there are; the tests hold the two against one another.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from typing import NamedTuple


class Segment(NamedTuple):
    """An outline segment: both ends, and the direction of the normal away from the sensor."""

    ax: float
    ay: float
    bx: float
    by: float
    normal: float

    @property
    def centre(self) -> complex:
        return complex(0.5 * (self.ax + self.bx), 0.5 * (self.ay + self.by))


class Side(NamedTuple):
    """A side of a model: its middle, direction and length."""

    x: float
    y: float
    direction: float
    length: float


class Reading(NamedTuple):
    """One range: where the sensor was, where it looked, what it read, when."""

    x: float
    y: float
    axis: float
    range: float
    t: float


def angle_between(a: float, b: float) -> float:
    """Unsigned angle between two directions, by the vectors' own argument."""
    return abs(cmath.phase(cmath.rect(1.0, a - b)))


def undirected(angle: float) -> float:
    """The angle of an undirected line brought into (−π/2, π/2] by whole half turns."""
    while angle > math.pi / 2:
        angle -= math.pi
    while angle <= -math.pi / 2:
        angle += math.pi
    return angle


def tangent(first: Reading, second: Reading, half_angle: float) -> float | None:
    """Direction of the normal of the common tangent inside both beams, None where there is none (McKerrow)."""
    p1, p2 = complex(first.x, first.y), complex(second.x, second.y)
    baseline = abs(p2 - p1)
    difference = first.range - second.range
    if baseline == 0.0 or abs(difference) > baseline:
        return None
    roots = []
    for sign in (-1, 1):
        # The normal in the frame whose x axis runs from P1 to P2: its x is (r1 − r2)/L, its y completes the unit.
        n = complex(difference, sign * math.sqrt(baseline**2 - difference**2)) / baseline
        n *= (p2 - p1) / baseline
        alpha = cmath.phase(n)
        off = angle_between(alpha, first.axis), angle_between(alpha, second.axis)
        if max(off) <= half_angle:
            roots.append((off[0] ** 2 + off[1] ** 2, alpha))
    return min(roots)[1] if roots else None


def extract(history: Sequence[Reading], new: Reading, half_angle: float, least: float, most: float, gap: float
            ) -> Segment | None:  # fmt: skip
    """The segment of a new reading with the last one far enough back (paper §3.2)."""
    for old in reversed(history):
        if new.t - old.t > gap:
            return None
        baseline = math.dist((old.x, old.y), (new.x, new.y))
        if baseline < least:
            continue
        alpha = tangent(old, new, half_angle) if baseline <= most else None
        if alpha is None:
            return None
        n = cmath.rect(1.0, alpha)
        a = complex(old.x, old.y) + old.range * n
        b = complex(new.x, new.y) + new.range * n
        return Segment(a.real, a.imag, b.real, b.imag, alpha)
    return None


def clusters(segments: Sequence[Segment], threshold: float) -> list[list[int]]:
    """The paper's Table 1, word for word: members of each cluster."""
    found: list[list[int]] = []
    for i, s in enumerate(segments):
        if not found:
            found.append([i])
            continue
        centres = [sum(segments[k].centre for k in c) / len(c) for c in found]
        distances = [abs(c - s.centre) for c in centres]
        nearest = distances.index(min(distances))
        if distances[nearest] > threshold:
            found.append([i])
        else:
            found[nearest].append(i)
    return found


def increment(
    sides: Sequence[Side], segments: Sequence[Segment], gamma: float, x: float, y: float, theta: float
) -> tuple[float, float, float]:
    """F and τ of the paper's §3.4, formula by formula."""
    fields = []
    for side in sides:
        centre = complex(x, y) + cmath.rect(1.0, theta) * complex(side.x, side.y)
        sphere = gamma * side.length
        inside = []
        for s in segments:
            n = cmath.rect(1.0, s.normal)
            to_line = complex(s.ax, s.ay) - centre
            delta_n = (to_line.real * n.real + to_line.imag * n.imag) * n
            if abs(delta_n) >= sphere:
                continue
            delta_a = undirected(s.normal + math.pi / 2 - side.direction - theta)
            g_t = (sphere - abs(delta_n)) / sphere
            g_r = (math.pi / 2 - abs(delta_a)) / (math.pi / 2)
            inside.append((sphere - abs(delta_n), g_t * g_r * delta_n, g_t * delta_a))
        total = sum(pull for pull, _, _ in inside)
        force = sum(pull / total * f for pull, f, _ in inside) if inside else 0j
        torque = sum(pull / total * t for pull, _, t in inside) if inside else 0.0
        fields.append((len(inside), force, torque))
    influencing = sum(n for n, _, _ in fields)
    if influencing == 0:
        return 0.0, 0.0, 0.0
    whole = sum(n / influencing * f for n, f, _ in fields)
    turn = sum(n / influencing * t for n, _, t in fields)
    return complex(whole).real, complex(whole).imag, turn


def contradicted(segment: Segment, reading: Reading, half_angle: float, margin: float) -> bool:
    """Whether the sensor faced the segment squarely and yet heard an echo from behind it."""
    a, b = complex(segment.ax, segment.ay), complex(segment.bx, segment.by)
    if a == b or not math.isfinite(reading.range):
        return False
    p = complex(reading.x, reading.y)
    share = ((p - a) * (b - a).conjugate()).real / abs(b - a) ** 2
    foot = a + share * (b - a)
    in_beam = angle_between(cmath.phase(foot - p), reading.axis) <= half_angle
    return 0.0 <= share <= 1.0 and in_beam and abs(foot - p) < reading.range - margin


def goodness_of_fit(
    sides: Sequence[Side], segments: Sequence[Segment], x: float, y: float, theta: float, near: float, parallel: float
) -> tuple[int, float, float]:
    """Supporting segments, their rms distance from the outline, and the covered share of its length."""
    squares = []
    hit = set()
    for s in segments:
        local = (s.centre - complex(x, y)) * cmath.rect(1.0, -theta)
        distances = []
        for side in sides:
            u = cmath.rect(1.0, side.direction)
            off = (local - complex(side.x, side.y)) * u.conjugate()
            beyond = max(abs(off.real) - 0.5 * side.length, 0.0)
            distances.append(math.hypot(beyond, off.imag))
        nearest = distances.index(min(distances))
        turned = undirected(s.normal + math.pi / 2 - theta - sides[nearest].direction)
        if distances[nearest] <= near and abs(turned) <= parallel:
            squares.append(distances[nearest] ** 2)
            hit.add(nearest)
    if not squares:
        return 0, math.inf, 0.0
    covered = sum(sides[i].length for i in hit) / sum(side.length for side in sides)
    return len(squares), math.sqrt(sum(squares) / len(squares)), covered
