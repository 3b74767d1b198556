"""Random tracks, lines and readings of the Bayesian method's memory; shared by the tests of its kernels."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from config.load import load_settings
from perception.bayes.inference import reservoir
from perception.bayes.inference.kernel_settings import make_settings
from perception.bayes.inference.outline_map import bucket_index
from perception.bayes.inference.prediction import predict_circle
from perception.bayes.memory.elements import BUCKETS, Reading
from perception.bayes.memory.parameters import OUTLINE_CELL_M
from perception.bayes.memory.scratch import Predictions
from perception.bayes.memory.settings_record import RANGE_BINS_PER_M, Settings, SettingsRecord
from perception.bayes.memory.state import Memory
from perception.bayes.segments.segment_list import put_segment
from perception.kernel import Floats
from perception.records import Records, array_of, records, zeros
from perception.sensor_mounts import mounts_array
from perception.shared_numbers import FAR
from tests import naive_bayes

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


def examples(few: int, many: int) -> pytest.MarkDecorator:
    """Run a test on `few` random examples in every run, and on `many` of the same seed in `make soak`."""
    return pytest.mark.parametrize("examples", [few, pytest.param(many, marks=pytest.mark.soak)])


def noises() -> list[naive_bayes.Noise]:
    """Return the settings' noise hypotheses as the oracles take them."""
    table, bins_per_m = array_of(P)["table"][0], array_of(P)["table_bins_per_m"][0]
    return [naive_bayes.Noise(table, bins_per_m, noise.levels, RANGE_BINS_PER_M) for noise in S.noises]


def changed(p: SettingsRecord, **values: float) -> SettingsRecord:
    """Return a copy of settings with other values."""
    array = array_of(p).copy()
    for name, value in values.items():
        array[name] = value
    return records(Settings, array)


def sigma(memory: Memory) -> tuple[float, float]:
    """Return the assumed absolute (m) and relative noise."""
    absolute, relative = NOISES[memory.s[0].noise_level]
    return float(absolute), float(relative)


def readings_of(rows: Floats) -> Records[Reading]:
    """Return readings as kernels take them, from rows of place, axis and range."""
    array = zeros(Reading, len(rows))
    numbers(array)[:, :5] = np.asarray(rows).reshape(len(rows), 5)
    return records(Reading, array)


def numbers(array: Any) -> Floats:
    """Return records that hold nothing but floats as rows of floats: a view."""
    array = np.asarray(array)
    return np.ndarray((len(array), array.itemsize // 8), np.float64, array, 0, (array.strides[0], 8))


def keep(memory: Memory, t: int, w: Floats, bins: int = 36) -> None:
    """Store readings in a circle's reservoir, in turn in so many of its bins."""
    for j, q in enumerate(w):
        held = memory.circles["bins"][t, j % bins]
        held["readings"][j // bins] = (*q, 0.0, 0.0)
        held["count"] += 1


def enter_readings(memory: Memory, rows: Floats) -> None:
    """Put readings to the beginning of the scratch."""
    readings = numbers(memory.state["scratch"]["readings"][0])[: len(rows)]
    readings[:, :5], readings[:, 5:] = rows, 0.0


def predict_own(memory: Memory, n: int, centre: Floats, radius: float) -> None:
    """Write what a circle predicts of the first readings of the scratch to its `own`."""
    scratch = memory.s[0].scratch
    predict_circle(scratch.readings[:n], *pair(centre), radius, scratch.own)


def predictions() -> Predictions:
    """Return memory for what a circle predicts."""
    return records(Predictions, zeros(Predictions, 1))[0]


def scratch_readings(memory: Memory, n: int) -> Floats:
    """Return the first readings of the scratch as rows."""
    return numbers(memory.state["scratch"]["readings"][0])[:n, :5]


def history(memory: Memory, i: int) -> Floats:
    """Return a sensor's history as rows: a view."""
    return numbers(memory.state["sensors"]["history"][0, i])[:, :5]


def kept_by(memory: Memory, t: int) -> Floats:
    """Return the readings that a circle keeps, as rows."""
    n = reservoir.copy_reservoir(memory.tracks[t], memory.s[0].scratch.readings)
    return scratch_readings(memory, n)


def random_drive(
    rng: np.random.Generator, firings: int
) -> Iterator[tuple[tuple[float, float, float], float, np.ndarray]]:
    """Yield pose, time and ranges of a ring that moves, stops and turns; some ranges are lost or out of reach."""
    place, yaw, time_s, truth = np.zeros(2), 0.0, 0.0, rng.uniform(0.3, 2, SENSORS)
    for _ in range(firings):
        step = rng.choice([0.0, 0.01, 0.1])
        yaw += rng.choice([0.0, 0.01, 0.1]) * rng.normal()
        place = place + step * unit(yaw)
        time_s += rng.choice([0.2, 0.2, 0.2, 40.0], p=[0.33, 0.33, 0.33, 0.01])
        truth = np.abs(truth + rng.normal(0, 0.02, SENSORS) * (rng.random(SENSORS) < 0.5))
        chance = rng.random(SENSORS)
        ranges = np.where(chance < 0.4, np.nan, np.where(chance < 0.5, np.inf, truth))
        ranges[rng.random(SENSORS) < 0.01] = -1.0
        yield (float(place[0]), float(place[1]), yaw), time_s, ranges


def pair(v: np.ndarray) -> tuple[float, float]:
    """Return the first two numbers of an array."""
    return float(v[0]), float(v[1])


def unit(angle: Any) -> np.ndarray:
    """Return the unit vectors in these directions (rad), on a new last axis."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def around(rng: np.random.Generator, n: int, centre: Floats, rho: float) -> Floats:
    """Return readings of a circle as rows of place, axis and range: most are right, some wild, some silent."""
    bearing = rng.uniform(0, 2 * math.pi) + rng.uniform(0, 2 * math.pi, n) * rng.random()
    d = rho + rng.uniform(0.1, 3.0, n)
    r = np.maximum(0.0, d - rho + rng.normal(0, 0.01, n))
    chance = rng.random(n)
    r = np.where(chance < 0.15, rng.uniform(0, 4, n), np.where(chance < 0.25, 2 * FAR, r))
    axis = bearing + rng.uniform(-0.25, 0.25, n)
    return np.column_stack([centre - d[:, None] * unit(bearing), unit(axis), r])


def new_memory() -> Memory:
    """Return an empty memory for the shipped ring and a few circle tracks."""
    return Memory(SENSORS, TRACKS)


def random_track(rng: np.random.Generator, memory: Memory, t: int, status: int | None = None) -> None:
    """Fill a circle track at random; without `status` it may be free, tentative or established."""
    track = memory.tracks[t]
    track.status = int(rng.integers(3)) if status is None else status
    track.kind = k = int(rng.integers(len(RADII)))
    track.x, track.y = rng.uniform(-0.8, 0.8, 2)
    track.radius = RADII[k]
    track.root_xx, track.root_yy = rng.uniform(0, 0.02, 2)
    track.log_likelihood_ratio = rng.normal(20, 20)


def place_of(memory: Memory, t: int) -> Floats:
    """Return a track's centre, m."""
    return np.array([memory.circles["x"][t], memory.circles["y"][t]])


def add_segment(memory: Memory, row: Floats, number: int) -> int:
    """Put a segment (middle, normal) into the map; return its bucket."""
    x, y, nx, ny = row.tolist()
    put_segment(memory.s, x, y, nx, ny, number, 0.1 * number)
    return bucket_index(math.floor(x / OUTLINE_CELL_M), math.floor(y / OUTLINE_CELL_M), BUCKETS)


def places(memory: Memory) -> Floats:
    """Return the centres of all circles, shape (n, 2), m."""
    return np.column_stack([memory.circles["x"], memory.circles["y"]])
