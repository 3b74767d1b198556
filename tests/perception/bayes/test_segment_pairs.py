"""Segments from pairs, and the map that holds them, against their oracles."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.segment_pairs import SEG, map_add, map_near, tangent
from tests import naive_bayes as naive_full


def test_tangents_equal_their_oracle() -> None:
    rng = np.random.default_rng(2)
    half = math.radians(12)
    found = 0
    for _ in range(6000):
        a = np.array([*rng.normal(size=2), rng.uniform(-math.pi, math.pi), rng.uniform(0.2, 4)])
        b = np.array([*(a[:2] + rng.normal(size=2) * 0.4), a[2] + rng.normal() * 0.1, a[3] + rng.normal() * 0.15])
        out = np.full(SEG, np.nan)
        got = tangent(
            a[0], a[1], math.cos(a[2]), math.sin(a[2]), a[3], b[0], b[1], math.cos(b[2]), math.sin(b[2]), b[3],
            math.cos(half), 0.0004, out,
        )  # fmt: skip
        expected = naive_full.tangent(a, b, half)
        assert got == (expected is not None)
        if expected is None:
            continue
        found += 1
        middle, alpha = expected
        normal = np.array([math.cos(alpha), math.sin(alpha)])
        assert out[:2] == pytest.approx(middle, abs=1e-9)
        assert out[2:4] == pytest.approx(normal, abs=1e-9)
        ends = np.array([a[:2] + a[3] * out[2:4], b[:2] + b[3] * out[2:4]])
        assert math.dist(*ends) == pytest.approx(out[4], abs=1e-9)
        assert (ends[1] - ends[0]) @ out[2:4] == pytest.approx(0.0, abs=1e-12)
    assert found > 500


def test_a_segments_uncertainty_is_what_errors_of_its_ranges_make_of_it() -> None:
    rng = np.random.default_rng(3)
    sigma = 0.001
    seen, first = [], np.empty(SEG)
    assert tangent(0.0, 0.0, 1.0, 0.0, 2.0, 0.0, 0.3, 1.0, 0.0, 2.0, 0.9, sigma**2, first)
    for _ in range(4000):
        out = np.empty(SEG)
        r = 2.0 + rng.normal(size=2) * sigma
        assert tangent(0.0, 0.0, 1.0, 0.0, r[0], 0.0, 0.3, 1.0, 0.0, r[1], 0.9, sigma**2, out)
        seen.append((float(out[:2] @ first[2:4]), math.atan2(out[3], out[2])))
    assert np.std(seen, axis=0) == pytest.approx(first[5:7], rel=0.05)


def test_no_tangent_of_one_place_nor_of_impossible_ranges() -> None:
    out = np.empty(SEG)
    assert not tangent(0.0, 0.0, 1.0, 0.0, 2.0, 0.0, 0.0, 1.0, 0.0, 2.0, -1.0, 0.01, out)
    assert not tangent(0.0, 0.0, 1.0, 0.0, 2.0, 0.0, 0.3, 1.0, 0.0, 2.4, -1.0, 0.01, out)


@pytest.mark.parametrize("slots", [8, 64, 4096])
def test_the_map_equals_its_oracle(slots: int) -> None:
    rng = np.random.default_rng(slots)
    cell = 0.3
    tags, fill = np.zeros((slots, 2), np.int64), np.zeros(slots, np.int64)
    store, out = np.zeros((slots, 8, 4)), np.empty((2000, 4))
    oracle = naive_full.Buckets(slots, 8, cell)
    copied = 0
    for _ in range(2000):
        segment = rng.normal(size=SEG)
        map_add(segment, cell, tags, fill, store)
        oracle.add(segment)
        x, y = rng.normal(size=2)
        n = map_near(x, y, 0.4, cell, tags, fill, store, out)
        assert sorted(tuple(float(v) for v in row) for row in out[:n]) == oracle.near(x, y, 0.4)
        copied += n
    assert copied > 100


def test_what_does_not_fit_is_left_out() -> None:
    tags, fill, store = np.zeros((8, 2), np.int64), np.zeros(8, np.int64), np.zeros((8, 8, 4))
    for _ in range(20):
        map_add(np.array([0.1, 0.1, 1.0, 0.0]), 1.0, tags, fill, store)
    assert map_near(0.1, 0.1, 0.5, 1.0, tags, fill, store, np.empty((32, 4))) == 8
    assert map_near(0.1, 0.1, 0.5, 1.0, tags, fill, store, np.empty((3, 4))) == 3
