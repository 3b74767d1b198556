"""Slow, readable oracles of the kernels in `perception.bayes`, written from the mathematics with whole arrays.

They share no code with the product.
"""

from __future__ import annotations

import math
from collections import deque
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


class Noise(NamedTuple):
    """A noise hypothesis: the table of log ratios, its bins per metre and the level by range."""

    table: Array
    inv_step: Array
    levels: Array
    per_metre: float


def log_ratio(e: float, half_box: float, sigma: float, u0: float, eps: float) -> float:
    """Return the log of a box convolved with a Gaussian, mixed with outliers, over the background."""
    bell = NormalDist(0.0, sigma)
    if half_box > 0.0:
        density = (bell.cdf(half_box - abs(e)) - bell.cdf(-half_box - abs(e))) / (2.0 * half_box)
    else:
        density = bell.pdf(e)
    return math.log((1.0 - eps) * density / u0 + eps)


def nearest_level(sigma: float, sigmas: Array) -> int:
    """Return the level whose σ is nearest on a logarithmic scale."""
    return int(np.argmin(np.abs(np.log(sigmas) - math.log(sigma))))


def evidence(noise: Noise, r: Array, e: Array) -> Array:
    """Return the log ratio of each error at the level of its range."""
    level = noise.levels[np.minimum((r * noise.per_metre).astype(int), len(noise.levels) - 1)]
    bins = np.arange(noise.table.shape[1])
    return np.array(
        [
            np.interp(abs(x) * noise.inv_step[k], bins, noise.table[k])
            for x, k in zip(e, level, strict=True)
        ]
    )  # fmt: skip


def tangent(a: Array, b: Array, half_angle: float) -> tuple[Array, float] | None:
    """Return the middle of the tangent of two readings (x, y, axis, r) and its normal's direction."""
    phi = math.atan2(b[1] - a[1], b[0] - a[0])
    base = math.dist(a[:2], b[:2])
    if base == 0.0 or abs(a[3] - b[3]) > base:
        return None
    opening = math.acos((a[3] - b[3]) / base)
    fits = []
    for alpha in (phi - opening, phi + opening):
        off = [abs((alpha - axis + math.pi) % (2 * math.pi) - math.pi) for axis in (a[2], b[2])]
        if max(off) <= half_angle:
            fits.append((-math.cos(off[0]) - math.cos(off[1]), alpha))
    if not fits:
        return None
    alpha = min(fits)[1]
    normal = np.array([math.cos(alpha), math.sin(alpha)])
    return (a[:2] + a[3] * normal + b[:2] + b[3] * normal) / 2, alpha


class Buckets:
    """The segment map as a dictionary: each slot holds the newest segments of one cell."""

    def __init__(self, slots: int, capacity: int, cell: float) -> None:
        self.slots, self.capacity, self.cell = slots, capacity, cell
        self.cells: dict[int, tuple[tuple[int, int], deque[Array]]] = {}

    def slot(self, cell: tuple[int, int]) -> int:
        return ((cell[0] * 73856093) ^ (cell[1] * 19349663)) % self.slots

    def add(self, segment: Array) -> None:
        cell = (math.floor(segment[0] / self.cell), math.floor(segment[1] / self.cell))
        slot = self.slot(cell)
        if slot not in self.cells or self.cells[slot][0] != cell:
            self.cells[slot] = (cell, deque(maxlen=self.capacity))
        self.cells[slot][1].append(segment[:4].copy())

    def near(self, x: float, y: float, radius: float) -> list[tuple[float, ...]]:
        return sorted(
            tuple(float(v) for v in s) for _, kept in self.cells.values() for s in kept
            if (s[0] - x) ** 2 + (s[1] - y) ** 2 < radius**2
        )  # fmt: skip


class Look(NamedTuple):
    """A place seen from each sensor: its distance, the cosine of its angle off the axis, the unit vector to it."""

    d: Array
    cos: Array
    u: Array


def look(w: Array, place: Array) -> Look:
    """Return a place as seen from each sensor."""
    to = place - w[:, :2]
    d = np.hypot(to[:, 0], to[:, 1])
    u = to / d[:, None]
    return Look(d, (u * w[:, 2:4]).sum(1), u)


def score_circle(
    w: Array, centre: Array, rho: float, cosines: tuple[float, float, float], gate: float, miss: float, short: float,
    noise: Noise,
) -> dict[str, float]:  # fmt: skip
    """Return the evidence of readings for a circle, and its counts."""
    opt, half, inside = cosines
    seen = look(w, centre)
    e = w[:, 4] - (seen.d - rho)
    near = np.abs(e) <= gate
    may = near & (e > -gate) & (seen.cos >= opt)
    v = np.zeros(len(w))
    v[may] = evidence(noise, w[may, 4], e[may])
    v[may & (seen.cos < half)] = np.maximum(v[may & (seen.cos < half)], 0.0)
    hit = v > 0
    throughs = int(((e > gate) & (seen.cos >= inside)).sum())
    shorts = int(((e < -gate) & (seen.cos >= inside)).sum())
    extra = throughs - 0.2 * (hit.sum() + throughs)
    llr = v.sum() + throughs * miss + shorts * short - 2.0 * max(0.0, extra - 1.0)
    axes = w[hit, 2:4].sum(0)
    return {
        "llr": float(llr), "hits": float(hit.sum()), "throughs": throughs, "near": float(near.sum()),
        "closest": float(w[hit, 4].min(initial=1e9)),
        "dispersion": 1.0 - float(np.hypot(*axes)) / max(1.0, float(hit.sum())),
    }  # fmt: skip


def weights(e: Array, var: Array, soft: float) -> Array:
    """Return Geman and McClure's weights of residuals, over their variance."""
    return 1.0 / (var * (1.0 + e**2 / (soft * var)) ** 2)


def fit_circle(
    w: Array, centre: Array, rho: float, opt: float, gate: float, soft: float, var0: float, rel2: float, steps: int
) -> tuple[Array, Array]:
    """Return centre and information of a circle of known radius: damped, robust Gauss–Newton."""
    p = centre.copy()
    info = np.zeros((2, 2))
    for _ in range(steps):
        seen = look(w, p)
        e = w[:, 4] - (seen.d - rho)
        use = (np.abs(e) <= gate) & (seen.cos >= opt)
        g = weights(e[use], var0 + rel2 * w[use, 4] ** 2, soft)
        info = (seen.u[use].T * g) @ seen.u[use] + np.eye(2) * 1e-12 / var0
        delta = np.linalg.solve(info + 0.02 * np.trace(info) * np.eye(2), seen.u[use].T @ (g * e[use]))
        length = float(np.hypot(*delta))
        p += delta * min(1.0, 0.8 * gate / length) if length > 0 else 0.0
        if length < 4e-4 * gate:
            break
    return p, info


def line_error(w: Array, origin: Array, normal: Array, c: float) -> Array:
    """Return range less perpendicular distance to the line n·(p − o) = c."""
    return np.asarray(w[:, 4] - (c - (w[:, :2] - origin) @ normal))


def fit_line(
    w: Array, normal: Array, origin: Array, c: float, opt: float, gate: float, soft: float, var0: float, rel2: float,
    steps: int,
) -> tuple[Array, float]:  # fmt: skip
    """Return normal and distance of a line: damped, robust Gauss–Newton."""
    alpha = math.atan2(normal[1], normal[0])
    for _ in range(steps):
        n = np.array([math.cos(alpha), math.sin(alpha)])
        e = line_error(w, origin, n, c)
        use = (np.abs(e) <= gate) & (w[:, 2:4] @ n >= opt)
        if not use.any():
            break
        g = weights(e[use], var0 + rel2 * w[use, 4] ** 2, soft)
        along = (w[use, :2] - origin) @ np.array([n[1], -n[0]])  # the fall of the distance as the normal turns
        jacobian = np.column_stack([along, np.ones(len(g))])
        h = (jacobian.T * g) @ jacobian + np.diag([1e-9, 1e-12 / var0])
        delta = np.linalg.solve(h * np.array([[1.02, 1.0], [1.0, 1.02]]), jacobian.T @ (g * e[use]))
        alpha += float(np.clip(delta[0], -0.2, 0.2))
        c += float(delta[1])
        if abs(delta[0]) < 1e-5:
            break
    return np.array([math.cos(alpha), math.sin(alpha)]), c


def score_line(
    w: Array, normal: Array, origin: Array, c: float, cosines: tuple[float, float, float], gate: float, miss: float,
    noise: Noise, far: float,
) -> tuple[float, int, int, float, float]:  # fmt: skip
    """Return evidence, hits, throughs and extent of a line."""
    opt, half, inside = cosines
    e = line_error(w, origin, normal, c)
    cos = w[:, 2:4] @ normal
    foot = (w[:, :2] - origin) @ np.array([-normal[1], normal[0]])
    may = (cos >= opt) & (np.abs(e) < gate) & (w[:, 4] < far)
    v = np.zeros(len(w))
    v[may] = evidence(noise, w[may, 4], e[may])
    v[may & (cos < half)] = np.maximum(v[may & (cos < half)], 0.0)
    hit = v > 0
    low, high = foot[hit].min(initial=1e9), foot[hit].max(initial=-1e9)
    through = (w[:, 4] - e > 0) & (e > gate) & (cos >= inside) & (low < foot) & (foot < high)
    return float(v.sum() + miss * through.sum()), int(hit.sum()), int(through.sum()), float(low), float(high)


def posterior_circle(
    w: Array, rho: float, opt: float, gate: float, noise: Noise, pose: Array, root: Array
) -> tuple[Array, Array, Array]:
    """Return mean, root and covariance of a circle's centre from 7 × 7 cells one expected σ apart."""
    p, frame = pose.copy(), root.copy()
    cov = np.zeros((2, 2))
    cells = np.array([(a, b) for a in range(-3, 4) for b in range(-3, 4)], float)
    for _ in range(4):
        seen = look(w, p)
        e = w[:, 4] - (seen.d - rho)
        use = (np.abs(e) <= gate) & (seen.cos >= opt)
        ll = np.array([evidence(noise, w[use, 4], e[use] - seen.u[use] @ frame @ cell).sum() for cell in cells])
        mass = np.where(ll - ll.max() < -30.0, 0.0, np.exp(ll - ll.max()))
        mean = np.average(cells, axis=0, weights=mass)
        spread = np.average([np.outer(q, q) for q in cells], axis=0, weights=mass) - np.outer(mean, mean)
        rim = bool(np.abs(cells[np.argmax(ll)]).max() == 3)
        p += frame @ mean
        believed = spread.copy()
        np.fill_diagonal(believed, np.maximum(spread.diagonal(), 0.06))
        limit = 0.95 * math.sqrt(believed[0, 0] * believed[1, 1])
        believed[0, 1] = believed[1, 0] = np.clip(spread[0, 1], -limit, limit)
        cov = frame @ believed @ frame.T * (2.0 if rim else 1.0)
        least = (2e-4 * gate) ** 2
        r00 = math.sqrt(np.clip(cov[0, 0], least, gate**2))
        r10 = float(np.clip(cov[0, 1] / r00, -gate, gate))
        frame = np.array([[r00, 0.0], [r10, math.sqrt(np.clip(cov[1, 1] - r10**2, least, gate**2))]])
        sizes = spread.diagonal()
        if not rim and np.abs(mean).max() <= 1.2 and sizes.min() >= 0.3 and sizes.max() <= 2.2:
            break
    return p, frame, cov


def corner(
    w: Array, centre: Array, rho: float, opt: float, gate: float, var0: float, rel2: float, noise: Noise
) -> float | None:
    """Return the evidence of two faces and their edge for a circle's near readings, less the price."""
    seen = look(w, centre)
    near = np.abs(w[:, 4] - (seen.d - rho)) < gate
    w, u = w[near], seen.u[near]
    if len(w) < 8:
        return None
    mean = u.sum(0) / np.hypot(*u.sum(0))
    left = mean[0] * u[:, 1] - mean[1] * u[:, 0] > 0
    faces: list[tuple[Array, float]] = []
    for mine in (left, ~left):
        if mine.sum() < 3:
            return None
        n = u[mine].sum(0) / np.hypot(*u[mine].sum(0))
        faces.append(fit_line(w[mine], n, centre, -rho, opt - 0.02, gate, 9.0, var0, rel2, 3))

    def corner() -> Array | None:
        (n0, c0), (n1, c1) = faces
        normals = np.array([n0, n1])
        if abs(np.linalg.det(normals)) <= 0.2:
            return None
        return np.asarray(centre + np.linalg.solve(normals, np.array([c0, c1])))

    edge = corner()
    for _ in range(2):
        for side in range(2):
            e = [np.abs(line_error(w, centre, n, c)) + 2.0 * gate * (w[:, 2:4] @ n < opt) for n, c in faces]
            mine = (e[0] <= e[1]) == (side == 0)
            if edge is not None:
                mine &= np.minimum(e[0], e[1]) <= np.abs(w[:, 4] - look(w, edge).d) + 0.04 * gate
            if mine.sum() >= 3:
                n, c = faces[side]
                faces[side] = fit_line(w[mine], n, centre, c, opt - 0.02, gate, 9.0, var0, rel2, 3)
        edge = corner()
    best = np.zeros(len(w))
    errors = [np.abs(line_error(w, centre, n, c)) for n, c in faces]
    for side, (n, c) in enumerate(faces):
        v = evidence(noise, w[:, 4], line_error(w, centre, n, c))
        is_heard = w[:, 2:4] @ n >= opt
        if edge is not None:  # a face ends there
            feet = (w[:, :2] - edge) @ np.array([-n[1], n[0]])
            own = is_heard & (errors[side] <= errors[1 - side])
            way = 1.0 if np.where(feet[own] > 0.0, 1, -1).sum() > 0 else -1.0
            is_heard &= way * feet >= 0.0
        best = np.maximum(best, np.where(is_heard, v, 0.0))
    if edge is not None:
        there = look(w, edge)
        v = evidence(noise, w[:, 4], w[:, 4] - there.d)
        best = np.maximum(best, np.where(there.cos >= opt, v, 0.0))
    floor = float(noise.table[0, -1])
    return float(np.where(best > 0, best - 0.4, floor).sum() - 8.0)
