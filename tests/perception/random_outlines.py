"""Random outline segments and model sides for the kernels' tests, as arrays and as their oracles take them."""

from __future__ import annotations

import math

import numpy as np

from perception.kernel import Floats
from tests import naive

EXACT = 1e-12
"""Largest difference between a kernel and its oracle: rounding only."""


def random_segments(rng: np.random.Generator, n: int, spread: float) -> Floats:
    """Return segments of 0.05 to 0.5 m anywhere in a square, in every direction."""
    middle = rng.uniform(-spread, spread, (n, 2))
    normal = rng.uniform(-math.pi, math.pi, n)
    half = 0.5 * rng.uniform(0.05, 0.5, n)
    along = np.column_stack([-np.sin(normal), np.cos(normal)]) * half[:, None]
    return np.column_stack([middle - along, middle + along, normal])


def as_segments(rows: Floats) -> list[naive.Segment]:
    return [naive.Segment(*map(float, row)) for row in rows]


def random_sides(rng: np.random.Generator, n: int) -> Floats:
    return np.column_stack(
        [rng.uniform(-0.5, 0.5, (n, 2)), rng.uniform(-math.pi, math.pi, n), rng.uniform(0.05, 0.8, n)]
    )
