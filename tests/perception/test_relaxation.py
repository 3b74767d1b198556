"""Relaxation against the paper's formulas (tests/naive.py), on random cases."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.relaxation import increment, relax
from tests import naive
from tests.perception.random_outlines import EXACT, as_segments, random_segments, random_sides


def test_increment_equals_the_papers_formulas() -> None:
    rng = np.random.default_rng(5)
    moved = 0
    for _ in range(400):
        sides = random_sides(rng, int(rng.integers(1, 8)))
        rows = random_segments(rng, 40, 1.0)
        members = rng.permutation(40)[: int(rng.integers(0, 30))].astype(np.int64)
        x, y, theta = rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-4, 4)
        got = increment(sides, rows, members, 2.0, x, y, theta)
        model = [naive.Side(*map(float, row)) for row in sides]
        expected = naive.increment(model, as_segments(rows[members]), 2.0, x, y, theta)
        assert got == pytest.approx(expected, abs=EXACT)
        moved += got != (0.0, 0.0, 0.0)
    assert moved > 330


def test_increment_without_near_segments_is_zero() -> None:
    rows = random_segments(np.random.default_rng(6), 5, 0.1)
    rows[:, :4] += 100.0
    rows[:, 4] = math.pi / 4  # the infinite lines are far away too, not only the segments
    none, five = np.zeros(0, dtype=np.int64), np.arange(5)
    sides = np.array([[0.0, 0.0, 0.0, 0.3]])
    assert increment(sides, rows, none, 2.0, 0.0, 0.0, 0.0) == (0.0, 0.0, 0.0)
    assert increment(sides, rows, five, 2.0, 0.0, 0.0, 0.0) == (0.0, 0.0, 0.0)


def test_relaxation_repeats_the_increment_until_it_is_negligible() -> None:
    rng = np.random.default_rng(7)
    for _ in range(12):
        sides = random_sides(rng, 4)
        rows = random_segments(rng, 20, 0.6)
        members = np.arange(20)
        pose = rng.uniform(-0.3, 0.3, 3)
        x, y, theta = (float(v) for v in pose)
        steps, rests = 0, False
        while steps < 50 and not rests:
            dx, dy, turn = increment(sides, rows, members, 2.0, x, y, theta)
            x, y, theta, steps = x + dx, y + dy, theta + turn, steps + 1
            rests = math.hypot(dx, dy) < 1e-4 and abs(turn) < 1e-4
        assert relax(sides, rows, members, 2.0, 1e-4, 1e-4, 50, pose) == (steps, rests)
        assert tuple(pose) == (x, y, theta)
