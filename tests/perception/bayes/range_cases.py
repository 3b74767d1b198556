"""Random readings of circles, edges and walls, and the settings that they are scored with."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple, TypeVar

import numpy as np

from perception.bayes.inference.likelihood import build_levels, build_table
from perception.bayes.memory.elements import Reading
from perception.bayes.memory.settings_record import RANGE_BINS_PER_M, TABLE_LEVELS, NoiseModel, SettingsRecord
from perception.kernel import Floats
from perception.records import Record, Records, array_of, records, zeros
from perception.shared_numbers import FAR
from tests import naive_bayes
from tests.perception.bayes.random_tracks import P as SHIPPED
from tests.perception.bayes.random_tracks import changed, numbers, pair, readings_of

R = TypeVar("R", bound=Record)

HALF_BOX = 0.01524
GATE = 0.1524
MISS, SHORT = math.log(0.1), -1.0
OPT, HALF, IN = (math.cos(math.radians(a)) for a in (12.4, 12.0, 10.5))
COSINES = (OPT, HALF, IN)
"""Cosines of the angles within which a reading may answer, lies in the beam, and must answer."""


class Case(NamedTuple):
    """Readings near a circle, and the noise that is assumed."""

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
    """Yield readings of a circle, a box's corner or a wall: rounded, noisy, with outliers and lost echoes."""
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
            r = rng.uniform(0.15, 4.5) if chance < 0.1 else FAR if chance < 0.15 else max(r, 0.02)
            w[j] = (
                *(centre - d * np.array([math.cos(bearing), math.sin(bearing)])),
                math.cos(axis),
                math.sin(axis),
                r,
            )
        var0 = noises[h, 0] ** 2 + HALF_BOX**2 / 3 + 1e-7
        noise = naive_bayes.Noise(table, bins_per_m, levels[h], RANGE_BINS_PER_M)
        yield Case(w, n, centre + rng.normal(0, 0.03, 2), rho, float(var0), float(noises[h, 1] ** 2), noise, p, h)
