"""Scores, fits, posterior and corner against their oracles on random readings of circles, edges and walls."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple, TypeVar

import numpy as np
import pytest

from perception.bayes import range_fit
from perception.bayes.circle_posterior import posterior_circle
from perception.bayes.corner_model import IMPOSSIBLE_NAT, score_corner
from perception.bayes.elements import Reading
from perception.bayes.likelihood import build_levels, build_table
from perception.bayes.scratch import CircleFit, CirclePosterior, LinearReading, LineFit, LineScore, Score
from perception.bayes.settings_record import RANGE_BINS_PER_M, TABLE_LEVELS, NoiseModel, SettingsRecord
from perception.bayes.state import Memory
from perception.kernel import Floats
from perception.records import Record, Records, array_of, records, zeros
from tests import naive_bayes
from tests.perception.tracks import P as SHIPPED
from tests.perception.tracks import changed, enter_readings, numbers, readings_of

R = TypeVar("R", bound=Record)

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
    noise: naive_bayes.Noise
    p: SettingsRecord
    level: int

    @property
    def used(self) -> np.ndarray:
        return self.w[: self.n]

    @property
    def readings(self) -> Records[Reading]:
        return readings_of(self.used)

    @property
    def place(self) -> tuple[float, float]:
        return pair(self.centre)


def one(record: type[R]) -> tuple[Records[R], Floats]:
    """Return a record as kernels take it, and its fields as an array: a view."""
    array = zeros(record, 1)
    return records(record, array), numbers(array)[0]


def score_circle(case: Case, readings: Records[Reading], x: float, y: float) -> Floats:
    """Return the fields of the score: evidence, hits, misses, near, shorts, closest, dispersion, sure hits."""
    score, fields = one(Score)
    range_fit.score_circle(readings, x, y, case.rho, case.p, case.level, score[0])
    return fields


def noisy_settings(noises: Floats) -> tuple[SettingsRecord, Floats]:
    """Return settings with these noises, and the noise of each level."""
    p, sigmas = changed(
        SHIPPED, half_resolution_m=HALF_BOX, gate_m=GATE, missed_echo_nat=MISS, short_echo_nat=SHORT,
        cos_may_answer=OPT, cos_half_angle=HALF, cos_must_answer=IN,
    ), np.empty(TABLE_LEVELS)  # fmt: skip
    array = array_of(p)
    build_table(HALF_BOX, 0.0003, 0.18, 1 / 4.5, 0.03, array["table"][0], array["table_bins_per_m"][0], sigmas)
    models = array["noises"][0]
    models["absolute_m"][: len(noises)], models["relative"][: len(noises)] = noises.T
    build_levels(records(NoiseModel, models), sigmas)
    return p, sigmas


def cases(
    count: int, seed: int, kinds: tuple[str, ...] = ("circle", "edge", "wall"), least: int = 3
) -> Iterator[Case]:
    """Readings of a circle, of a box's corner or of a wall, rounded and noisy, with outliers and silence."""
    rng = np.random.default_rng(seed)
    noises = np.array([(a, b) for a in (0.001, 0.01, 0.025) for b in (0.0, 0.01)])
    p, _ = noisy_settings(noises)
    array = array_of(p)
    table, bins_per_m, levels = array["table"][0], array["table_bins_per_m"][0], array["noises"]["levels"][0]
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
            r = rng.uniform(0.15, 4.5) if chance < 0.1 else range_fit.FAR if chance < 0.15 else max(r, 0.02)
            w[j] = (
                *(centre - d * np.array([math.cos(bearing), math.sin(bearing)])),
                math.cos(axis),
                math.sin(axis),
                r,
            )
        var0 = noises[h, 0] ** 2 + HALF_BOX**2 / 3 + 1e-7
        noise = naive_bayes.Noise(table, bins_per_m, levels[h], RANGE_BINS_PER_M)
        yield Case(w, n, centre + rng.normal(0, 0.03, 2), rho, float(var0), float(noises[h, 1] ** 2), noise, p, h)


def first_normal(case: Case) -> np.ndarray:
    to = case.centre - case.used[:, :2].mean(0)
    return np.asarray(to / np.hypot(*to))


def test_a_circles_score_equals_its_oracle() -> None:
    hits = 0.0
    for case in cases(2000, 1):
        fields = score_circle(case, case.readings, *case.place)
        want = naive_bayes.score_circle(case.used, case.centre, case.rho, COSINES, GATE, MISS, SHORT, case.noise)
        names = ("llr", "hits", "throughs", "near", "shorts", "closest")
        assert fields[:6] == pytest.approx([want[name] for name in names], rel=1e-12, abs=1e-11)
        assert fields[6] == pytest.approx(want["dispersion"], abs=1e-12)
        hits += fields[1]
    assert hits > 10_000


def test_a_circles_fit_equals_its_oracle() -> None:
    for case in cases(2000, 2):
        fit, out = one(CircleFit)
        assert range_fit.fit_circle(
            case.readings, *case.place, case.rho, case.p, 9.0, case.var0, case.rel2, 4, fit[0]
        )  # fmt: skip
        p, info = naive_bayes.fit_circle(
            case.used, case.centre, case.rho, OPT, GATE, 9.0, case.var0, case.rel2, 4
        )  # fmt: skip
        assert out[:2] == pytest.approx(p, abs=1e-10)
        assert out[2:] == pytest.approx([info[0, 0], info[0, 1], info[1, 1]], rel=1e-7, abs=1e-7)


def test_a_lines_fit_and_score_equal_their_oracles() -> None:
    for case in cases(2000, 3):
        n0, (fit, out), (score, fields) = first_normal(case), one(LineFit), one(LineScore)
        range_fit.fit_line(
            case.readings, *pair(n0), *case.place, -case.rho, OPT, GATE, 9.0, case.var0, case.rel2, 4, fit[0]
        )
        n, c = naive_bayes.fit_line(case.used, n0, case.centre, -case.rho, OPT, GATE, 9.0, case.var0, case.rel2, 4)
        # a lone reading leaves the turn to the damping alone: hence not 1e-12
        assert out == pytest.approx([*n, c], abs=1e-6)
        range_fit.score_line(case.readings, fit[0], *case.place, case.p, case.level, score[0])
        want = naive_bayes.score_line(
            case.used, out[:2], case.centre, float(out[2]), COSINES, GATE, MISS, case.noise, range_fit.FAR
        )
        assert fields == pytest.approx(want, rel=1e-12, abs=1e-11)


def circle_posterior(case: Case, readings: Records[Reading], start: tuple[float, ...]) -> Floats:
    """Return centre, root and covariance, each as xx, yx, yy, from a centre and a root."""
    posterior, fields = one(CirclePosterior)
    fields[:5] = start
    linear = records(LinearReading, zeros(LinearReading, len(readings)))
    posterior_circle(readings, case.rho, case.p, case.level, linear, np.zeros(49), posterior[0])
    return fields


def test_the_posterior_equals_its_oracle() -> None:
    for case in cases(150, 4):
        p, frame, spread = naive_bayes.posterior_circle(
            case.used, case.rho, OPT, GATE, case.noise, case.centre.copy(), np.array([[0.01, 0.0], [0.003, 0.015]])
        )
        fields = circle_posterior(case, case.readings, (*case.place, 0.01, 0.003, 0.015))
        assert fields[:2] == pytest.approx(p, abs=1e-10)
        assert fields[2:5] == pytest.approx([frame[0, 0], frame[1, 0], frame[1, 1]], abs=1e-9)
        assert fields[5:] == pytest.approx([spread[0, 0], spread[0, 1], spread[1, 1]], abs=1e-10)


def test_the_posterior_beats_least_squares_where_ranges_are_only_rounded() -> None:
    """Sixty rounded, otherwise perfect ranges all round a drum: the box's posterior against the fit on the same."""
    p, _ = noisy_settings(np.array([[0.0, 0.0]]))
    case = next(cases(1, 5))._replace(rho=0.3, p=p, level=0)
    rng = np.random.default_rng(5)
    exact, fitted = [], []
    for _ in range(60):
        w = np.zeros((60, 5))
        for j in range(60):
            b, d = rng.uniform(0, 2 * math.pi), rng.uniform(0.5, 3)
            u = np.array([math.cos(b), math.sin(b)])
            w[j] = (*(-d * u), *u, round((d - 0.3) / (2 * HALF_BOX)) * 2 * HALF_BOX)
        fit, out = one(CircleFit)
        pose = circle_posterior(case, readings_of(w), (0.01, -0.01, 0.003, 0.0, 0.003))
        range_fit.fit_circle(readings_of(w), 0.01, -0.01, 0.3, p, 9.0, HALF_BOX**2 / 3, 0.0, 8, fit[0])
        exact.append(math.hypot(*pose[:2]))
        fitted.append(math.hypot(*out[:2]))
    assert np.mean(exact) < 0.6 * np.mean(fitted)


def test_a_corners_score_equals_its_oracle() -> None:
    found, memory = 0, Memory(4, 1)
    for case in cases(700, 6, ("circle", "edge"), least=12):
        enter_readings(memory, case.used)
        memory.s[0].noise_level = case.level
        got = score_corner(memory.s, case.p, case.n, *case.place, case.rho, case.var0, case.rel2)
        want = naive_bayes.corner(case.used, case.centre, case.rho, OPT, GATE, case.var0, case.rel2, case.noise)
        if want is None:
            assert got == IMPOSSIBLE_NAT
        else:
            found += 1
            assert got == pytest.approx(want, abs=1e-6)
    assert found > 200


def test_readings_of_nothing_fit_nothing() -> None:
    case = next(cases(1, 7))
    silent = case.used.copy()
    silent[:, 4] = range_fit.FAR
    fit, out = one(CircleFit)
    assert range_fit.fit_circle(readings_of(silent), 0.2, 0.3, 0.3, case.p, 9.0, case.var0, case.rel2, 4, fit[0])
    assert out[:2] == pytest.approx([0.2, 0.3], abs=1e-12)
    fields = score_circle(case._replace(rho=0.3), readings_of(silent), 0.2, 0.3)
    assert fields[1] == 0
    assert fields[0] <= 0
