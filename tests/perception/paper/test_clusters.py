"""Clustering against the paper's Table 1 (tests/naive.py), on random cases."""

from __future__ import annotations

import numpy as np

from perception.kernel import Floats, Ints
from perception.paper.clusters import cluster_segments, group_by_cluster
from tests import naive
from tests.perception.random_outlines import EXACT, as_segments, random_segments


def run_clusters(rows: Floats, status: Ints, start: int, count: int, threshold: float) -> list[list[int]]:
    """Return the members of each cluster; check sizes and centres."""
    labels = np.full(len(rows), -7, dtype=np.int64)
    centres, sizes = np.zeros((64, 2)), np.zeros(64, dtype=np.int64)
    offsets, members = np.zeros(65, dtype=np.int64), np.zeros(len(rows), dtype=np.int64)
    n = cluster_segments(rows, status, start, count, threshold, labels, centres, sizes)
    group_by_cluster(labels, start, count, sizes, n, offsets, members)
    groups = [[int(m) for m in members[offsets[j] : offsets[j + 1]]] for j in range(n)]
    for j, group in enumerate(groups):
        assert sizes[j] == len(group)
        middle = 0.5 * (rows[group, 0:2] + rows[group, 2:4])
        np.testing.assert_allclose(centres[j], middle.mean(axis=0), atol=EXACT)
    return groups


def test_clusters_equal_table_1() -> None:
    rng = np.random.default_rng(3)
    for _ in range(60):
        capacity = int(rng.integers(8, 80))
        rows = random_segments(rng, capacity, 2.0)
        status = (rng.uniform(size=capacity) < 0.8).astype(np.int64)
        start, count = int(rng.integers(capacity)), int(rng.integers(1, capacity + 1))
        slots = [(start + k) % capacity for k in range(count)]
        present = [s for s in slots if status[s]]
        expected = [[present[k] for k in c] for c in naive.clusters(as_segments(rows[present]), 0.7)]
        assert run_clusters(rows, status, start, count, 0.7) == expected


def test_clusters_without_room_leave_segments_out() -> None:
    rows = random_segments(np.random.default_rng(4), 10, 50.0)
    labels, status = np.zeros(10, dtype=np.int64), np.ones(10, dtype=np.int64)
    n = cluster_segments(rows, status, 0, 10, 0.001, labels, np.zeros((3, 2)), np.zeros(3, dtype=np.int64))
    assert n == 3
    assert list(labels) == [0, 1, 2] + [-1] * 7
