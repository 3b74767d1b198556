"""Every kernel of perception against its slow oracle in tests/naive.py, on thousands of random cases."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.kernel import Floats, Ints
from perception.paper.candidates import follow_clusters
from perception.paper.clusters import cluster_segments, group_by_cluster
from perception.paper.outline_map import erase_contradicted
from perception.paper.recognition import goodness_of_fit
from perception.paper.segments import pair_readings, tangent
from perception.relaxation import increment, relax
from tests import naive

EXACT = 1e-12


def random_segments(rng: np.random.Generator, n: int, spread: float) -> Floats:
    """Segments of 0.05 to 0.5 m anywhere in a square, in every direction."""
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


def test_tangent_equals_its_oracle() -> None:
    rng = np.random.default_rng(1)
    found = 0
    for _ in range(20_000):
        x1, y1, axis1 = rng.uniform(-3, 3, 3)
        x2, y2 = x1 + rng.uniform(-0.5, 0.5), y1 + rng.uniform(-0.5, 0.5)
        axis2 = axis1 + rng.uniform(-0.3, 0.3)
        r1 = rng.uniform(0.2, 5)
        r2 = r1 + rng.uniform(-0.4, 0.4)
        half = rng.uniform(0.05, 1.5)
        first, second = naive.Reading(x1, y1, axis1, r1, 0.0), naive.Reading(x2, y2, axis2, r2, 0.0)
        expected = naive.tangent(first, second, half)
        ok, alpha = tangent(x1, y1, axis1, r1, x2, y2, axis2, r2, half)
        assert ok == (expected is not None)
        if expected is not None:
            found += 1
            steep = math.sqrt(1.0 - ((r1 - r2) / math.hypot(x2 - x1, y2 - y1)) ** 2)
            assert naive.angle_between(alpha, expected) < EXACT / steep  # dα/dr is 1/(L·steep): what rounding leaves
            n1 = math.cos(alpha) * x1 + math.sin(alpha) * y1 + r1
            n2 = math.cos(alpha) * x2 + math.sin(alpha) * y2 + r2
            assert n1 == pytest.approx(n2, abs=EXACT)  # the defining property, to full precision everywhere
    assert found > 3_000


def test_tangent_of_a_wall_is_the_wall() -> None:
    """Two sensors in front of a wall at x = 2, looking at it under 0.1 rad, moving along and towards it."""
    ok, alpha = tangent(0.0, 0.0, 0.1, 2.0, 0.1, 0.3, 0.1, 1.9, 0.2)
    assert ok
    assert alpha == pytest.approx(0.0, abs=EXACT)


def test_no_tangent_outside_the_beams_nor_for_impossible_ranges() -> None:
    assert not tangent(0.0, 0.0, 1.0, 2.0, 0.1, 0.3, 1.0, 1.9, 0.2)[0]
    assert not tangent(0.0, 0.0, 0.0, 2.0, 0.0, 0.3, 0.0, 2.5, 1.5)[0]
    assert not tangent(0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 2.0, 1.5)[0]


def test_pairing_equals_its_oracle_along_random_drives() -> None:
    rng = np.random.default_rng(2)
    made = 0
    for _ in range(30):
        mounts = np.column_stack([rng.uniform(-0.4, 0.4, (6, 2)), rng.uniform(-math.pi, math.pi, 6)])
        kept = np.zeros((6, 16, 5))
        newest, filled = np.zeros(6, dtype=np.int64), np.zeros(6, dtype=np.int64)
        out = np.zeros((6, 5))
        history: list[list[naive.Reading]] = [[] for _ in range(6)]
        x, y, yaw, t, spacing = 0.0, 0.0, 0.0, 0.0, 0.05
        base = rng.uniform(1.0, 3.0, 6)
        for _ in range(60):
            x, y, yaw = x + rng.uniform(0, 0.08), y + rng.uniform(-0.02, 0.02), yaw + rng.uniform(-0.02, 0.02)
            t += float(rng.choice([0.05, 0.1, 0.7]))
            ranges = base + rng.uniform(-0.05, 0.05, 6)
            ranges[rng.uniform(size=6) < 0.1] = math.nan
            ranges[rng.uniform(size=6) < 0.1] = math.inf
            n = pair_readings(
                ranges, mounts, x, y, yaw, t, kept, newest, filled, 0.6, 0.2, 0.4, 2.0, spacing, out
            )  # fmt: skip
            expected = []
            for i in range(6):
                if not math.isfinite(ranges[i]):
                    continue
                place = complex(x, y) + complex(mounts[i, 0], mounts[i, 1]) * complex(math.cos(yaw), math.sin(yaw))
                new = naive.Reading(place.real, place.imag, yaw + mounts[i, 2], ranges[i], t)
                last = history[i][-1] if history[i] else None
                if last and t - last.t <= 2.0 and math.dist((last.x, last.y), (new.x, new.y)) < spacing:
                    continue
                segment = naive.extract(history[i], new, 0.6, 0.2, 0.4, 2.0)
                if segment is not None:
                    expected.append(segment)
                history[i] = [*history[i], new][-16:]
            assert n == len(expected)
            made += n
            np.testing.assert_allclose(out[:n, :4], np.array(expected).reshape(-1, 5)[:, :4], atol=EXACT)
    assert made > 1_000


def run_clusters(rows: Floats, alive: Ints, start: int, count: int, threshold: float) -> list[list[int]]:
    labels = np.full(len(rows), -7, dtype=np.int64)
    centres, sizes = np.zeros((64, 2)), np.zeros(64, dtype=np.int64)
    offsets, members = np.zeros(65, dtype=np.int64), np.zeros(len(rows), dtype=np.int64)
    n = cluster_segments(rows, alive, start, count, threshold, labels, centres, sizes)
    group_by_cluster(labels, start, count, sizes, n, offsets, members)
    groups = [[int(m) for m in members[offsets[j] : offsets[j + 1]]] for j in range(n)]
    for j, group in enumerate(groups):
        assert sizes[j] == len(group)
        middle = 0.5 * (rows[group, 0:2] + rows[group, 2:4])
        np.testing.assert_allclose(centres[j], middle.mean(axis=0), atol=EXACT)
    return groups


def test_clusters_equal_table_1() -> None:
    rng = np.random.default_rng(3)
    for _ in range(300):
        capacity = int(rng.integers(8, 80))
        rows = random_segments(rng, capacity, 2.0)
        alive = (rng.uniform(size=capacity) < 0.8).astype(np.int64)
        start, count = int(rng.integers(capacity)), int(rng.integers(1, capacity + 1))
        slots = [(start + k) % capacity for k in range(count)]
        living = [s for s in slots if alive[s]]
        expected = [[living[k] for k in c] for c in naive.clusters(as_segments(rows[living]), 0.7)]
        assert run_clusters(rows, alive, start, count, 0.7) == expected


def test_clusters_without_room_leave_segments_out() -> None:
    rows = random_segments(np.random.default_rng(4), 10, 50.0)
    labels, alive = np.zeros(10, dtype=np.int64), np.ones(10, dtype=np.int64)
    n = cluster_segments(rows, alive, 0, 10, 0.001, labels, np.zeros((3, 2)), np.zeros(3, dtype=np.int64))
    assert n == 3
    assert list(labels) == [0, 1, 2] + [-1] * 7


def test_increment_equals_the_papers_formulas() -> None:
    rng = np.random.default_rng(5)
    moved = 0
    for _ in range(3_000):
        sides = random_sides(rng, int(rng.integers(1, 8)))
        rows = random_segments(rng, 40, 1.0)
        members = rng.permutation(40)[: int(rng.integers(0, 30))].astype(np.int64)
        x, y, theta = rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-4, 4)
        got = increment(sides, rows, members, 2.0, x, y, theta)
        model = [naive.Side(*map(float, row)) for row in sides]
        expected = naive.increment(model, as_segments(rows[members]), 2.0, x, y, theta)
        assert got == pytest.approx(expected, abs=EXACT)
        moved += got != (0.0, 0.0, 0.0)
    assert moved > 2_500


def test_increment_of_nothing_near_is_zero() -> None:
    rows = random_segments(np.random.default_rng(6), 5, 0.1)
    rows[:, :4] += 100.0
    rows[:, 4] = math.pi / 4  # the lines themselves stay far away, not only the segments
    none, five = np.zeros(0, dtype=np.int64), np.arange(5)
    sides = np.array([[0.0, 0.0, 0.0, 0.3]])
    assert increment(sides, rows, none, 2.0, 0.0, 0.0, 0.0) == (0.0, 0.0, 0.0)
    assert increment(sides, rows, five, 2.0, 0.0, 0.0, 0.0) == (0.0, 0.0, 0.0)


def test_relaxation_repeats_the_increment_until_it_is_negligible() -> None:
    rng = np.random.default_rng(7)
    for _ in range(200):
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


def test_contradiction_equals_its_oracle() -> None:
    rng = np.random.default_rng(8)
    erased = 0
    for _ in range(2_000):
        capacity, start, count = 30, int(rng.integers(30)), int(rng.integers(31))
        rows = random_segments(rng, capacity, 2.0)
        rows[rng.integers(capacity), 2:4] = rows[0, 0:2]
        alive = (rng.uniform(size=capacity) < 0.8).astype(np.int64)
        mounts = np.column_stack([rng.uniform(-0.4, 0.4, (8, 2)), rng.uniform(-math.pi, math.pi, 8)])
        x, y, yaw = (float(v) for v in rng.uniform(-2, 2, 3))
        ranges = rng.uniform(0.2, 4.0, 8)
        ranges[0], ranges[1] = math.nan, math.inf
        turn = complex(math.cos(yaw), math.sin(yaw))
        readings = [
            naive.Reading((p := complex(x, y) + complex(m[0], m[1]) * turn).real, p.imag, yaw + m[2], r, 0.0)
            for m, r in zip(mounts, ranges, strict=True)
        ]
        used = {(start + k) % capacity for k in range(count)}
        expected = alive.copy()
        for i, segment in enumerate(as_segments(rows)):
            if i in used and any(naive.contradicted(segment, r, 0.4, 0.2) for r in readings):
                expected[i] = 0
        n = erase_contradicted(rows, alive, start, count, ranges, mounts, x, y, yaw, 0.4, 0.2)
        np.testing.assert_array_equal(alive, expected)
        erased += n
    assert erased > 500


def test_goodness_of_fit_equals_its_oracle() -> None:
    rng = np.random.default_rng(9)
    supported = 0
    for _ in range(2_000):
        sides = random_sides(rng, int(rng.integers(1, 7)))
        rows = random_segments(rng, 25, 0.8)
        members = rng.permutation(25)[: int(rng.integers(0, 25))].astype(np.int64)
        x, y, theta = (float(v) for v in rng.uniform(-1, 1, 3))
        got = goodness_of_fit(sides, rows, members, x, y, theta, 0.2, 0.6, np.zeros(len(sides), dtype=np.int64))
        model = [naive.Side(*map(float, row)) for row in sides]
        expected = naive.goodness_of_fit(model, as_segments(rows[members]), x, y, theta, 0.2, 0.6)
        assert got == pytest.approx(expected, abs=EXACT)
        supported += got[0]
    assert supported > 1_000


def test_clusters_are_followed_nearest_pair_first() -> None:
    rng = np.random.default_rng(10)
    for _ in range(500):
        old = rng.uniform(-2, 2, (int(rng.integers(0, 8)), 2))
        new = rng.uniform(-2, 2, (int(rng.integers(0, 8)), 2))
        pairs = sorted((math.dist(a, b), i, j) for i, a in enumerate(old) for j, b in enumerate(new))
        expected = [-1] * len(new)
        for distance, i, j in pairs:
            if distance < 0.8 and expected[j] < 0 and i not in expected:
                expected[j] = i
        heir = np.full(len(new), 99, dtype=np.int64)
        follow_clusters(old, new, 0.8, heir)
        assert list(heir) == expected
