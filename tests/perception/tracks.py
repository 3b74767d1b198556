"""Random tracks, lines and readings for what the Bayesian method remembers; shared by the tests of its kernels."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from config.load import load_settings
from perception.bayes.kernel_settings import make_settings
from perception.bayes.range_fit import FAR
from perception.bayes.state import (
    KIND,
    LLR,
    NL,
    NOISE,
    R00,
    R11,
    ST,
    TRHO,
    TX,
    TY,
    State,
    make_state,
)  # fmt: skip
from perception.sensor_mounts import mounts_array
from tests import naive_bayes as naive_full
from tests.naive_tracks import Line

SETTINGS = load_settings("hallway", ["perception.method=bayes"])

BOXES = load_settings("hallway", ["perception.method=bayes"], models=("semicircle", "box"))

MOUNTS = mounts_array(SETTINGS.ring.mounts)

SENSORS = len(MOUNTS)

P = make_settings(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.bayes)

COSINES = (P.cos_opt, P.cos_half, P.cos_in)

TRACKS = 8

RIVALS = len(P.radii) + 2


def noises() -> list[naive_full.Noise]:
    return [naive_full.Noise(P.table, P.inv_step, levels, P.per_metre) for levels in P.levels]


def sigma(s: State) -> tuple[float, float]:
    absolute, relative = P.noises[int(s.g[NOISE])]
    return float(absolute), float(relative)


def pair(v: np.ndarray) -> tuple[float, float]:
    return float(v[0]), float(v[1])


def quintuple(q: np.ndarray) -> tuple[float, float, float, float, float]:
    return float(q[0]), float(q[1]), float(q[2]), float(q[3]), float(q[4])


def unit(angle: Any) -> np.ndarray:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def around(rng: np.random.Generator, n: int, centre: np.ndarray, rho: float) -> np.ndarray:
    """Readings x, y, axis, range of a circle: good ones, wild ones and silences."""
    bearing = rng.uniform(0, 2 * math.pi) + rng.uniform(0, 2 * math.pi, n) * rng.random()
    d = rho + rng.uniform(0.1, 3.0, n)
    r = np.maximum(0.0, d - rho + rng.normal(0, 0.01, n))
    chance = rng.random(n)
    r = np.where(chance < 0.15, rng.uniform(0, 4, n), np.where(chance < 0.25, 2 * FAR, r))
    axis = bearing + rng.uniform(-0.25, 0.25, n)
    return np.column_stack([centre - d[:, None] * unit(bearing), unit(axis), r])


def shared() -> State:
    return make_state(SENSORS, P, TRACKS, 64)


def random_track(rng: np.random.Generator, s: State, t: int, state: int | None = None) -> None:
    s.ti[t, ST] = rng.integers(3) if state is None else state
    s.ti[t, KIND] = k = int(rng.integers(len(P.radii)))
    s.tf[t, [TX, TY]] = rng.uniform(-0.8, 0.8, 2)
    s.tf[t, TRHO] = P.radii[k]
    s.tf[t, [R00, R11]] = rng.uniform(0, 0.02, 2)
    s.tf[t, LLR] = rng.normal(20, 20)


def random_lines(rng: np.random.Generator, s: State, many: int) -> dict[int, Line]:
    """Lines in some of the rows of the memory, as tall as they may be wrong."""
    s.lines[...] = 0.0
    lines = {}
    for k in sorted(rng.choice(NL, many, replace=False).tolist()):
        root = np.array([[rng.uniform(0.001, 0.1), 0.0], [rng.normal(0, 0.01), rng.uniform(0.001, 0.05)]])
        lines[k] = Line(
            unit(rng.uniform(-math.pi, math.pi)), rng.uniform(-0.2, 2), rng.uniform(-1, 1, 2), root @ root.T,
            -rng.uniform(0, 2), rng.uniform(0, 2), rng.uniform(0, 6), float(rng.integers(1, 30)),
        )  # fmt: skip
        s.lines[k] = lines[k].row()
    return lines
