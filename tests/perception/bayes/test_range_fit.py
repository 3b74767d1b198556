"""Scores, fits, posterior and wedge against their oracles on random readings of circles, edges and walls."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pytest

from perception.bayes import range_fit as contact
from perception.bayes.circle_posterior import posterior_circle
from perception.bayes.corner_model import IMPOSSIBLE, wedge
from perception.bayes.likelihood import BINS, LEVELS, build_levels, build_table
from tests import naive_bayes as naive_full

HALF_BOX = 0.01524
GATE = 0.1524
MISS, SHORT = math.log(0.1), -1.0
OPT, HALF, IN = (math.cos(math.radians(a)) for a in (12.4, 12.0, 10.5))
COSINES = (OPT, HALF, IN)


def pair(values: np.ndarray) -> tuple[float, float]:
    return float(values[0]), float(values[1])


class Case(NamedTuple):
    w: np.ndarray
    n: int
    centre: np.ndarray
    rho: float
    var0: float
    rel2: float
    noise: naive_full.Noise

    @property
    def used(self) -> np.ndarray:
        return self.w[: self.n]

    @property
    def tables(self) -> tuple[np.ndarray, float, np.ndarray, np.ndarray]:
        """What kernels are told of the noise."""
        return self.noise.levels, self.noise.per_metre, self.noise.table, self.noise.inv_step

    @property
    def place(self) -> tuple[float, float]:
        return pair(self.centre)


def score_circle(case: Case, w: np.ndarray, x: float, y: float, stats: np.ndarray) -> None:
    contact.score_circle(
        w, case.n, x, y, case.rho, OPT, HALF, IN, GATE, MISS, SHORT, *case.tables, stats
    )  # fmt: skip


def cases(
    count: int, seed: int, kinds: tuple[str, ...] = ("circle", "edge", "wall"), least: int = 3
) -> Iterator[Case]:
    """Readings of a circle, of a box's corner or of a wall, rounded and noisy, with outliers and silence."""
    rng = np.random.default_rng(seed)
    table, inv_step, sigmas = np.empty((LEVELS, BINS)), np.empty(LEVELS), np.empty(LEVELS)
    build_table(HALF_BOX, 0.0003, 0.18, 1 / 4.5, 0.03, table, inv_step, sigmas)
    noises = np.array([(a, b) for a in (0.001, 0.01, 0.025) for b in (0.0, 0.01)])
    levels = np.empty((len(noises), 64), np.int64)
    build_levels(noises, sigmas, levels, 6.5)
    for i in range(count):
        kind = kinds[i % len(kinds)]
        h = int(rng.integers(len(noises)))
        n = int(rng.integers(least, 80))
        rho = float(rng.choice([0.0, 0.1, 0.3, 0.67]))
        centre = rng.uniform(-1, 1, 2)
        w = np.zeros((160, 5))
        middle, span = rng.uniform(0, 2 * math.pi), rng.uniform(0.3, 2 * math.pi)
        for j in range(n):
            bearing = middle + rng.uniform(-0.5, 0.5) * span
            d = rng.uniform(rho + 0.2, 3.6)
            axis = bearing + rng.uniform(-0.25, 0.25)
            r = d - rho
            if kind == "edge":
                r = min(d, *(max(0.05, d * math.cos(bearing - middle + a) - 0.25) for a in (-0.4, 0.4)))
            elif kind == "wall":
                r = max(0.05, d * math.cos(bearing - middle) - rho)
            r = round((r + rng.normal() * 0.01) / (2 * HALF_BOX)) * 2 * HALF_BOX + 0.0041
            chance = rng.random()
            r = rng.uniform(0.15, 4.5) if chance < 0.1 else contact.FAR if chance < 0.15 else max(r, 0.02)
            w[j] = (
                *(centre - d * np.array([math.cos(bearing), math.sin(bearing)])),
                math.cos(axis),
                math.sin(axis),
                r,
            )
        var0 = noises[h, 0] ** 2 + HALF_BOX**2 / 3 + 1e-7
        noise = naive_full.Noise(table, inv_step, levels[h], 6.5)
        yield Case(w, n, centre + rng.normal(0, 0.03, 2), rho, float(var0), float(noises[h, 1] ** 2), noise)


def first_normal(case: Case) -> np.ndarray:
    to = case.centre - case.used[:, :2].mean(0)
    return np.asarray(to / np.hypot(*to))


def test_a_circles_score_equals_its_oracle() -> None:
    hits = 0.0
    for case in cases(2000, 1):
        stats = np.zeros(9)
        score_circle(case, case.w, *case.place, stats)
        want = naive_full.score_circle(case.used, case.centre, case.rho, COSINES, GATE, MISS, SHORT, case.noise)
        order = (contact.LLR, contact.HITS, contact.THROUGHS, contact.NEAR, contact.SHORTS, contact.CLOSEST)
        names = ("llr", "hits", "throughs", "near", "shorts", "closest")
        assert stats[list(order)] == pytest.approx([want[name] for name in names], rel=1e-12, abs=1e-11)
        assert stats[contact.DISPERSION] == pytest.approx(want["dispersion"], abs=1e-12)
        hits += stats[contact.HITS]
    assert hits > 10_000


def test_a_circles_fit_equals_its_oracle() -> None:
    for case in cases(2000, 2):
        out = np.zeros(5)
        assert contact.fit_circle(case.w, case.n, *case.place, case.rho, OPT, GATE, 9.0, case.var0, case.rel2, 4, out)
        p, info = naive_full.fit_circle(
            case.used, case.centre, case.rho, OPT, GATE, 9.0, case.var0, case.rel2, 4
        )  # fmt: skip
        assert out[:2] == pytest.approx(p, abs=1e-10)
        assert out[2:] == pytest.approx([info[0, 0], info[0, 1], info[1, 1]], rel=1e-7, abs=1e-7)


def test_a_lines_fit_and_score_equal_their_oracles() -> None:
    for case in cases(2000, 3):
        n0, out, stats = first_normal(case), np.zeros(3), np.zeros(6)
        contact.fit_line(
            case.w, case.n, *pair(n0), *case.place, -case.rho, OPT, GATE, 9.0, case.var0, case.rel2, 4, out
        )
        n, c = naive_full.fit_line(case.used, n0, case.centre, -case.rho, OPT, GATE, 9.0, case.var0, case.rel2, 4)
        # a lone reading leaves the turn to the damping alone: hence not 1e-12
        assert out == pytest.approx([*n, c], abs=1e-6)
        (nx, ny), (x, y) = pair(out), case.place
        contact.score_line(
            case.w, case.n, nx, ny, x, y, out[2], OPT, HALF, IN, GATE, MISS, *case.tables, stats
        )  # fmt: skip
        llr, hits, throughs, low, high = naive_full.score_line(
            case.used, out[:2], case.centre, float(out[2]), COSINES, GATE, MISS, case.noise, contact.FAR
        )
        assert stats[[0, 1, 2, 4, 5]] == pytest.approx([llr, hits, throughs, low, high], rel=1e-12, abs=1e-11)


def test_the_posterior_equals_its_oracle() -> None:
    work, wlev = np.zeros((160, 5)), np.zeros(160, np.int64)
    for case in cases(150, 4):
        pose, root, cov = case.centre.copy(), np.array([0.01, 0.003, 0.015]), np.zeros(3)
        p, frame, spread = naive_full.posterior_circle(
            case.used, case.rho, OPT, GATE, case.noise, pose, np.array([[0.01, 0.0], [0.003, 0.015]])
        )
        posterior_circle(case.w, case.n, case.rho, OPT, GATE, *case.tables, work, wlev, pose, root, cov)
        assert pose == pytest.approx(p, abs=1e-10)
        assert root == pytest.approx([frame[0, 0], frame[1, 0], frame[1, 1]], abs=1e-9)
        assert cov == pytest.approx([spread[0, 0], spread[0, 1], spread[1, 1]], abs=1e-10)


def test_the_posterior_beats_least_squares_where_ranges_are_only_rounded() -> None:
    """Sixty rounded, otherwise perfect ranges all round a drum: the box's posterior against the fit on the same."""
    case = next(cases(1, 5))
    rng = np.random.default_rng(5)
    work, wlev = np.zeros((160, 5)), np.zeros(160, np.int64)
    exact, fitted = [], []
    for _ in range(60):
        w = np.zeros((60, 5))
        for j in range(60):
            b, d = rng.uniform(0, 2 * math.pi), rng.uniform(0.5, 3)
            u = np.array([math.cos(b), math.sin(b)])
            w[j] = (*(-d * u), *u, round((d - 0.3) / (2 * HALF_BOX)) * 2 * HALF_BOX)
        pose, root, cov, out = np.array([0.01, -0.01]), np.array([0.003, 0.0, 0.003]), np.zeros(3), np.zeros(5)
        levels = np.zeros(64, np.int64)
        posterior_circle(
            w, 60, 0.3, OPT, GATE, levels, 6.5, case.noise.table, case.noise.inv_step, work, wlev, pose, root, cov
        )
        contact.fit_circle(w, 60, 0.01, -0.01, 0.3, OPT, GATE, 9.0, HALF_BOX**2 / 3, 0.0, 8, out)
        exact.append(math.hypot(*pose))
        fitted.append(math.hypot(*out[:2]))
    assert np.mean(exact) < 0.6 * np.mean(fitted)


def test_the_wedge_equals_its_oracle() -> None:
    found = 0
    for case in cases(700, 6, ("circle", "edge"), least=12):
        fit, stats = np.zeros(3), np.zeros(8)
        x, y = case.place
        got = wedge(
            case.w, np.zeros_like(case.w), case.n, x, y, case.rho, OPT, GATE, case.var0, case.rel2,
            *case.tables, fit, stats,
        )  # fmt: skip
        want = naive_full.wedge(case.used, case.centre, case.rho, OPT, GATE, case.var0, case.rel2, case.noise)
        if want is None:
            assert got == IMPOSSIBLE
        else:
            found += 1
            assert got == pytest.approx(want, abs=1e-6)
    assert found > 200


def test_readings_of_nothing_fit_nothing() -> None:
    case = next(cases(1, 7))
    silent = case.w.copy()
    silent[:, 4] = contact.FAR
    out, stats = np.zeros(5), np.zeros(9)
    assert contact.fit_circle(silent, case.n, 0.2, 0.3, 0.3, OPT, GATE, 9.0, case.var0, case.rel2, 4, out)
    assert out[:2] == pytest.approx([0.2, 0.3], abs=1e-12)
    score_circle(case._replace(rho=0.3), silent, 0.2, 0.3, stats)
    assert stats[contact.HITS] == 0
    assert stats[contact.LLR] <= 0
