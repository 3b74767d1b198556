"""Candidates follow their clusters by position."""

from __future__ import annotations

import math

import numpy as np

from perception.paper.candidates import follow_clusters


def test_clusters_are_followed_nearest_pair_first() -> None:
    rng = np.random.default_rng(10)
    for _ in range(200):
        old = rng.uniform(-2, 2, (int(rng.integers(0, 8)), 2))
        new = rng.uniform(-2, 2, (int(rng.integers(0, 8)), 2))
        pairs = sorted((math.dist(a, b), i, j) for i, a in enumerate(old) for j, b in enumerate(new))
        expected = [-1] * len(new)
        for distance, i, j in pairs:
            if distance < 0.8 and expected[j] < 0 and i not in expected:
                expected[j] = i
        predecessor = np.full(len(new), 99, dtype=np.int64)
        follow_clusters(old, new, 0.8, predecessor)
        assert list(predecessor) == expected
