"""Random tracks, lines and readings for what the Bayesian method remembers; shared by the tests of its kernels."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from config.load import load_settings
from perception.bayes.elements import MAX_LINES, Reading
from perception.bayes.kernel_settings import make_settings
from perception.bayes.range_fit import FAR
from perception.bayes.settings_record import RANGE_BINS_PER_M, Settings, SettingsRecord
from perception.bayes.state import Memory
from perception.kernel import Floats
from perception.records import Records, array_of, records, zeros
from perception.sensor_mounts import mounts_array
from tests import naive_bayes
from tests.naive_tracks import Line

SETTINGS = load_settings("hallway", ["perception.method=bayes"])

BOXES = load_settings("hallway", ["perception.method=bayes"], models=("semicircle", "box"))

MOUNTS = mounts_array(SETTINGS.ring.mounts)

SENSORS = len(MOUNTS)

P = make_settings(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.bayes)

S = P[0]

RADII = np.array([circle.radius_m for circle in S.circles[: S.circle_count]])

NOISES = np.array([(noise.absolute_m, noise.relative) for noise in S.noises])

COSINES = (S.cos_may_answer, S.cos_half_angle, S.cos_must_answer)

TRACKS = 8

ALTERNATIVES = len(RADII) + 2


def noises() -> list[naive_bayes.Noise]:
    table, bins_per_m = array_of(P)["table"][0], array_of(P)["table_bins_per_m"][0]
    return [naive_bayes.Noise(table, bins_per_m, noise.levels, RANGE_BINS_PER_M) for noise in S.noises]


def changed(p: SettingsRecord, **values: float) -> SettingsRecord:
    """Return a copy of settings with other values."""
    array = array_of(p).copy()
    for name, value in values.items():
        array[name] = value
    return records(Settings, array)


def sigma(memory: Memory) -> tuple[float, float]:
    absolute, relative = NOISES[memory.s[0].noise_level]
    return float(absolute), float(relative)


def readings_of(rows: Floats) -> Records[Reading]:
    """Return readings as kernels take them, from rows of place, axis and range."""
    array = zeros(Reading, len(rows))
    numbers(array)[...] = np.asarray(rows).reshape(len(rows), 5)
    return records(Reading, array)


def numbers(array: Any) -> Floats:
    """Return records that hold nothing but floats as rows of floats: a view."""
    array = np.asarray(array)
    return np.ndarray((len(array), array.itemsize // 8), np.float64, array, 0, (array.strides[0], 8))


def enter_readings(memory: Memory, rows: Floats) -> None:
    """Put readings to the beginning of the scratch."""
    numbers(memory.state["scratch"]["readings"][0])[: len(rows)] = rows


def scratch_readings(memory: Memory, n: int) -> Floats:
    """Return the first readings of the scratch as rows."""
    return numbers(memory.state["scratch"]["readings"][0])[:n]


def pair(v: np.ndarray) -> tuple[float, float]:
    return float(v[0]), float(v[1])


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


def shared() -> Memory:
    return Memory(SENSORS, TRACKS)


def random_track(rng: np.random.Generator, memory: Memory, t: int, state: int | None = None) -> None:
    track = memory.tracks[t]
    track.status = int(rng.integers(3)) if state is None else state
    track.kind = k = int(rng.integers(len(RADII)))
    track.x, track.y = rng.uniform(-0.8, 0.8, 2)
    track.radius = RADII[k]
    track.root_xx, track.root_yy = rng.uniform(0, 0.02, 2)
    track.log_likelihood_ratio = rng.normal(20, 20)


def place_of(memory: Memory, t: int) -> Floats:
    """Return a track's centre, m."""
    return np.array([memory.circles["x"][t], memory.circles["y"][t]])


def line_rows(memory: Memory) -> Floats:
    """Return the lines as rows, as `naive_tracks.Line.row` writes them: a view."""
    return numbers(memory.state["lines"][0])


def random_lines(rng: np.random.Generator, memory: Memory, many: int) -> dict[int, Line]:
    """Lines in some of the rows of the memory, as tall as they may be wrong."""
    line_rows(memory)[...] = 0.0
    lines = {}
    for k in sorted(rng.choice(MAX_LINES, many, replace=False).tolist()):
        root = np.array([[rng.uniform(0.001, 0.1), 0.0], [rng.normal(0, 0.01), rng.uniform(0.001, 0.05)]])
        lines[k] = Line(
            unit(rng.uniform(-math.pi, math.pi)), rng.uniform(-0.2, 2), rng.uniform(-1, 1, 2), root @ root.T,
            -rng.uniform(0, 2), rng.uniform(0, 2), rng.uniform(0, 6), float(rng.integers(1, 30)),
        )  # fmt: skip
        line_rows(memory)[k] = lines[k].row()
    return lines
