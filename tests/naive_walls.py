"""Slow, readable oracles of walls: where a beam touches a line, least squares, and where two lines cross.

They share no code with the product; constants are repeated.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def touch(sensor: Array, axis: float, half_angle: float, normal: float, distance: float) -> tuple[float, float]:
    """Return the range and the position along the line n · x = distance of its nearest point in a beam, by search.

    The position is measured from the foot of the origin, to the left of the normal.
    """
    n, t = (np.array([math.cos(a), math.sin(a)]) for a in (normal, normal + math.pi / 2))
    rays = axis + np.linspace(-half_angle, half_angle, 4001)
    ranges = (distance - n @ sensor) / np.cos(rays - normal)
    k = int(np.argmin(ranges))
    point = sensor + ranges[k] * np.array([math.cos(rays[k]), math.sin(rays[k])])
    return float(ranges[k]), float(t @ point)


def answer(sensor: Array, axis: float, half_angle: float, normal: float, distance: float) -> tuple[float, float]:
    """Return the same as `touch`, in closed form."""
    off = (axis - normal + math.pi) % (2.0 * math.pi) - math.pi
    ray = normal if abs(off) <= half_angle else axis - math.copysign(half_angle, off)
    n, t = (np.array([math.cos(a), math.sin(a)]) for a in (normal, normal + math.pi / 2))
    reach = float((distance - n @ sensor) / math.cos(ray - normal))
    return reach, float(t @ (sensor + reach * np.array([math.cos(ray), math.sin(ray)])))


def line_fit(u: Array, z: Array, w: Array) -> tuple[Array, Array]:
    """Return offset and slope of z over u with weights w, and their covariance, with the product's weak priors."""
    rows = np.concatenate(
        [np.sqrt(w)[:, None] * np.column_stack([np.ones_like(u), u]), np.diag([1e-3**0.5, 1.0 / 0.15])]
    )
    solution = np.linalg.lstsq(rows, np.concatenate([np.sqrt(w) * z, [0.0, 0.0]]), rcond=None)[0]
    return solution, np.linalg.inv(rows.T @ rows)


def line_chi2(u: Array, e: Array, sigma: Array) -> float:
    """Return χ² of the best line, where each error counts 16 at most."""
    rows = np.column_stack([np.ones_like(u), u]) / sigma[:, None]
    squares = (e / sigma - rows @ np.linalg.lstsq(rows, e / sigma, rcond=None)[0]) ** 2
    return float(np.minimum(squares, 16.0).sum())


def best_circle(u: Array, e: Array, d: Array, sigma: Array, radius: float) -> tuple[Array, Array]:
    """Return where a circle's centre lies best, along and behind a line, and its squared errors, by gradients.

    Sensors lie before the line's positions `u`, and hear ranges `d`, longer by `e` than to the line.
    """

    def errors(centre: Array) -> Array:
        return np.asarray((d - np.hypot(u - centre[0], d - e + centre[1]) + radius) / sigma)

    def residuals(centre: Array) -> Array:
        return np.append(errors(centre), [centre[0] / 0.5, (centre[1] - radius) / 0.2])

    centre = np.array([0.0, radius])
    for _ in range(40):
        left = residuals(centre)
        slopes = np.column_stack([(residuals(centre + h) - left) / 1e-6 for h in 1e-6 * np.eye(2)])
        centre = centre - np.linalg.lstsq(slopes, left, rcond=None)[0]
    return centre, errors(centre) ** 2


def crossing(normal_a: Array, distance_a: float, normal_b: Array, distance_b: float) -> Array:
    """Return where two lines n · x = distance cross."""
    return np.linalg.solve(np.stack([normal_a, normal_b]), [distance_a, distance_b])


def is_edge(way_a: float, normal_a: float, way_b: float, normal_b: float) -> bool | None:
    """Return whether two half-lines from one point make an edge, by the free sector between them; None: neither.

    Angles (rad) of the half-lines and of their normals away from the sensors: what is free beside a half-line lies
    opposite to its normal.
    """
    turn_a, turn_b = (
        math.copysign(1.0, math.sin(n + math.pi - w)) for w, n in ((way_a, normal_a), (way_b, normal_b))
    )
    if turn_a == turn_b:  # turning from a, what is free, b would be reached from behind
        return None
    return turn_a * (way_b - way_a) % (2.0 * math.pi) > math.pi


def corner_and_lines(
    angles: Array, distances: Array, roots: list[Array], sensors: Array, ranges: Array, sigma: float, start: Array
) -> tuple[Array, Array]:  # fmt: skip
    """Return two lines' corrections of angle and distance, and their corner, by Gauss-Newton over all at once.

    Parameters
    ----------
    angles, distances : (2,) float
        The lines: normals, rad, and distances from the origin, m.
    roots : list of (2, 2) float
        Roots of the information on each line's angle and distance.
    sensors, ranges : (n, 2) and (n,) float
        Who heard the corner, and at which range, m.
    sigma : float
        Of a range, m.
    start : (2,) float
        The corner at first, m.
    """
    x = np.concatenate([np.zeros(4), start])
    for _ in range(20):
        rows, errors = [], []
        for k in range(2):
            block = np.zeros((2, 6))
            block[:, 2 * k : 2 * k + 2] = roots[k]
            rows.append(block)
            errors.append(-block @ x)
            a, c = angles[k] + x[2 * k], distances[k] + x[2 * k + 1]
            n, t = np.array([math.cos(a), math.sin(a)]), np.array([-math.sin(a), math.cos(a)])
            on = np.zeros((1, 6))
            on[0, 2 * k], on[0, 2 * k + 1], on[0, 4:] = -(t @ x[4:]), 1.0, -n
            rows.append(on * 1e5)
            errors.append(np.array([n @ x[4:] - c]) * 1e5)
        delta = x[4:] - sensors
        reach = np.hypot(*delta.T)
        block = np.zeros((len(ranges), 6))
        block[:, 4:] = delta / reach[:, None]
        rows.append(block / sigma)
        errors.append((ranges - reach) / sigma)
        x = x + np.linalg.lstsq(np.concatenate(rows), np.concatenate(errors), rcond=None)[0]
    return x[:4], x[4:]


def likeliest_cover(evidence: Array, switch: float, unheard: float, most: float) -> list[bool]:
    """Return which places of a wall are covered, by the best of all sequences, each kept as a whole.

    Parameters
    ----------
    evidence : (n,) float
        For each place to be covered, nat; 0 where nothing was heard.
    switch, unheard, most : float
        Cost of a change, that of a covered place where nothing was heard, and the greatest evidence of a place, nat.
    """
    best: dict[bool, tuple[float, list[bool]]] = {False: (0.0, [])}
    for value in evidence.tolist():
        gain = {False: 0.0, True: float(np.clip(value, -most, most)) if value != 0.0 else -unheard}
        best = {
            now: max(
                (score + gain[now] - (switch if now != before else 0.0), [*places, now])
                for before, (score, places) in best.items()
            )
            for now in (False, True)
        }
    closed = {state: score - (switch if state else 0.0) for state, (score, _) in best.items()}
    return best[max(closed, key=lambda state: closed[state])][1]


def line_cuts(
    readings: Array, origin: Array, normal: float, offset: float, half_angle: float, slant: float
) -> tuple[Array, Array]:
    """Return where echoes' circles cut a line inside their beams, as positions along it, and their ranges.

    Parameters
    ----------
    readings : (n, 4) float
        Sensors' places and axes (rad), and ranges.
    origin, normal, offset
        The line: its frame's origin, its normal (rad), and its distance from the origin.
    half_angle, slant
        Of the beam (rad), and the least share of a range that runs along the line.
    """
    n, t = (np.array([math.cos(a), math.sin(a)]) for a in (normal, normal + math.pi / 2))
    cuts, ranges = [], []
    for x, y, axis, r in readings.tolist():
        off = offset + n @ origin - n @ np.array([x, y])
        for sign in (-1.0, 1.0):
            along = sign * math.sqrt(max(0.0, r * r - off * off))
            bearing = math.atan2(*(off * n + along * t)[::-1])
            is_ahead = abs((bearing - axis + math.pi) % (2.0 * math.pi) - math.pi) <= half_angle
            if math.isfinite(r) and abs(along) > slant * r and is_ahead:
                cuts.append(t @ (np.array([x, y]) - origin) + along)
                ranges.append(r)
    return np.array(cuts), np.array(ranges)
