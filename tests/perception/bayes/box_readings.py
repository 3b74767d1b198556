"""Outlines, readings of boxes as oracles predict them, and the settings that polygons are scored with."""

from __future__ import annotations

import math

import numpy as np

from config.load import load_model, load_settings
from perception.bayes.inference.kernel_settings import make_settings
from perception.bayes.memory.elements import POLYGON_BEARING_BINS
from perception.bayes.memory.scratch import Score
from perception.bayes.memory.settings_record import PolygonSide
from perception.bayes.memory.state import Memory
from perception.bayes.polygons.likelihood import score_polygon
from perception.kernel import Floats
from perception.records import Records, records, zeros
from perception.shared_numbers import FAR
from tests import naive_polygon
from tests.naive_polygon import Rule
from tests.perception.bayes.random_tracks import numbers, readings_of

SETTINGS = load_settings("hallway", ["perception.method=bayes"], models=("semicircle", "box"))
P = make_settings(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.bayes)
S = P[0]
MAY, MUST, HALF = math.acos(S.cos_may_answer), math.acos(S.cos_must_answer), S.half_angle_rad
"""Angles off the axis within which a reading may answer, must answer, and lies in the beam, rad."""
NOISE_M = 0.03 * 0.3048
CLOSED = True
BOX = np.array(load_model("box").vertices_m)
SIDES = S.polygons[0].sides[: S.polygons[0].side_count]
LEVEL = 9
"""The noise that is assumed: σ = 0.03 ft, 0.5 %."""


def sides_between(outline: Floats, closed: bool) -> Records[PolygonSide]:
    """Return the sides of an outline, shape (n, 2), as kernels take them."""
    along = np.roll(outline, -1, axis=0) - outline
    length = np.hypot(along[:, 0], along[:, 1])
    sides: Floats = np.column_stack([outline, along / length[:, None], length])
    array = zeros(PolygonSide, len(outline) - (not closed))
    numbers(array)[...] = sides[: len(array)]
    return records(PolygonSide, array)


def random_outline(rng: np.random.Generator) -> Floats:
    """Return a star-shaped outline, counterclockwise, 0.1 to 0.6 m about the origin."""
    n = int(rng.integers(3, 9))
    angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, n)) + np.arange(n) * 1e-3
    outline: Floats = rng.uniform(0.1, 0.6, n)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return outline


def rules(sensor: complex, axis: complex, pose: Floats, outline: Floats, closed: bool) -> tuple[Rule, Rule]:
    """Return what a sensor hears of an outline at a pose: as a mirror and as a cone."""
    turn = complex(math.cos(pose[2]), math.sin(pose[2]))
    return naive_polygon.predict(
        (sensor - complex(pose[0], pose[1])) / turn, axis / turn, [complex(x, y) for x, y in outline], closed=closed,
        may=MAY, must=MUST, half=HALF,
    )  # fmt: skip


def heard(rng: np.random.Generator, pose: Floats, n: int, noise_m: float, rule: int = 0) -> Floats:
    """Return rounded readings of a box from all sides, which answers as a mirror (0) or a cone (1)."""
    rows: list[tuple[float, ...]] = []
    while len(rows) < n:
        bearing, away = rng.uniform(-math.pi, math.pi), rng.uniform(0.8, 2.0)
        sensor = complex(pose[0], pose[1]) + away * complex(math.cos(bearing), math.sin(bearing))
        axis_angle = bearing + math.pi + rng.uniform(-0.5, 0.5)
        axis = complex(math.cos(axis_angle), math.sin(axis_angle))
        actual = rules(sensor, axis, pose, BOX, closed=True)[rule]
        r = FAR * 2.0
        if actual.expected is not None and actual.price == 0.0:
            r = round((actual.expected + rng.normal(0.0, noise_m)) / 0.03048) * 0.03048
        rows.append((sensor.real, sensor.imag, axis.real, axis.imag, r))
    return np.array(rows)


def score(w: Floats, pose: Floats, every: int = 1) -> tuple[float, Score]:
    """Return the evidence of readings at a pose, and the whole score."""
    result = records(Score, zeros(Score, 1))[0]
    x, y, heading = pose.tolist()
    return score_polygon(readings_of(w), every, (x, y, heading), SIDES, CLOSED, P, LEVEL, result), result


def evidence(w: Floats, pose: Floats) -> float:
    """Return the evidence (nat) of readings at a pose."""
    return score(w, pose)[0]


def random_pose(rng: np.random.Generator) -> Floats:
    """Return x, y (m) and heading (rad)."""
    return np.array([rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-math.pi, math.pi)])


def enter_job(memory: Memory, w: Floats, noise: int) -> None:
    """Give the job these readings and this noise."""
    numbers(memory.state["job_readings"][0])[: len(w), :5] = w
    memory.s[0].job.reading_count, memory.s[0].job.noise_level = len(w), noise


def keep_polygon_readings(memory: Memory, t: int, w: Floats) -> None:
    """Store readings in a polygon's reservoir, in turn in each of its bins."""
    for j, q in enumerate(w):
        held = memory.polygons["bins"][t, j % POLYGON_BEARING_BINS]
        held["readings"][j // POLYGON_BEARING_BINS] = (*q, 0.0, 0.0)
        held["count"] += 1
