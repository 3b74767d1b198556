"""Contact of polygons against its oracle, and the search for a pose on readings whose pose is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_model, load_settings
from perception.full.contact import FAR, HITS, LLR, NEAR, THROUGHS
from perception.full.polygon import MISS, MUST, STRONG, SURE, WEAK, predict, score_poly, search
from perception.full.settings import make_settings
from perception.kernel import Floats
from tests import naive_polygon

SETTINGS = load_settings("hallway", models=("semicircle", "box"))
P = make_settings(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.full)
MAY, IN, HALF = math.acos(P.cos_opt), math.acos(P.cos_in), P.half_angle
SILENT = 1e17
CLOSED = True
BOX = np.array(load_model("box").vertices_m)


def random_outline(rng: np.random.Generator) -> Floats:
    """A star-shaped outline, counterclockwise, 0.1 to 0.6 m about the origin."""
    n = int(rng.integers(3, 9))
    angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, n)) + np.arange(n) * 1e-3
    outline: Floats = rng.uniform(0.1, 0.6, n)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return outline


def heard(rng: np.random.Generator, pose: tuple[float, float, float], n: int, noise_m: float) -> Floats:
    """Readings of a box from all sides: what the strong side nearest sends back, rounded; far silence where none."""
    rows: list[tuple[float, ...]] = []
    corners = [complex(x, y) for x, y in BOX]
    turn = complex(math.cos(pose[2]), math.sin(pose[2]))
    while len(rows) < n:
        bearing, away = rng.uniform(-math.pi, math.pi), rng.uniform(0.8, 2.0)
        sensor = complex(pose[0], pose[1]) + away * complex(math.cos(bearing), math.sin(bearing))
        axis_angle = bearing + math.pi + rng.uniform(-0.5, 0.5)
        axis = complex(math.cos(axis_angle), math.sin(axis_angle))
        told = naive_polygon.predict(
            (sensor - complex(pose[0], pose[1])) / turn, axis / turn, 1.0, corners, closed=True, may=HALF, must=IN,
            half=HALF,
        )  # fmt: skip
        r = FAR * 2.0
        if told.strong is not None:
            r = round((told.strong + rng.normal(0.0, noise_m)) / 0.03048) * 0.03048
        rows.append((sensor.real, sensor.imag, axis.real, axis.imag, r))
    return np.array(rows)


def score(w: Floats, pose: Floats, stats: Floats) -> float:
    return score_poly(
        w, len(w), pose[0], pose[1], pose[2], BOX, 4, CLOSED, P.cos_opt, P.cos_in, P.cos_half, math.sin(HALF),
        P.gate, P.miss, P.short, P.levels[9], P.per_metre, P.table, P.inv_step, np.zeros(12), stats,
    )  # fmt: skip


def test_a_prediction_equals_its_oracle() -> None:
    rng = np.random.default_rng(1)
    answered = weak = must = 0
    for _ in range(6_000):
        outline = random_outline(rng)
        closed = bool(rng.integers(2))
        sensor = complex(*rng.uniform(-2.0, 2.0, 2))
        axis_angle = math.atan2(-sensor.imag, -sensor.real) + rng.uniform(-0.6, 0.6)
        axis = complex(math.cos(axis_angle), math.sin(axis_angle))
        r = max(0.05, abs(sensor) - rng.uniform(0.0, 0.8))
        expected = naive_polygon.predict(
            sensor, axis, r, [complex(x, y) for x, y in outline], closed=closed, may=MAY, must=IN, half=HALF
        )
        out = np.zeros(12)
        predict(
            sensor.real, sensor.imag, axis.real, axis.imag, r, outline, len(outline), closed, P.cos_opt, P.cos_in,
            P.cos_half, math.sin(HALF), out,
        )  # fmt: skip
        if expected.strong is None:
            assert out[STRONG] < 0.0
        else:
            assert out[STRONG] == pytest.approx(expected.strong, abs=1e-12)
        assert bool(out[MUST]) == expected.must
        if expected.miss is None:
            assert abs(out[MISS]) > SILENT
        else:
            assert out[MISS] == pytest.approx(expected.miss, abs=1e-12)
        assert bool(out[WEAK]) == expected.weak
        answered += expected.miss is not None
        weak += expected.weak
        must += expected.must
    assert min(answered - weak, weak, must) > 300


def test_a_score_counts_what_the_predictions_say() -> None:
    """Hits, readings near, drop-outs and strong hits, reading by reading; and their sum, by the table alone."""
    rng = np.random.default_rng(2)
    corners = [complex(x, y) for x, y in BOX]
    seen = np.zeros(3)
    for _ in range(400):
        truth = (rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-math.pi, math.pi))
        w = heard(rng, truth, 30, 0.01)
        w[rng.uniform(size=30) < 0.3, 4] *= rng.uniform(0.9, 1.8)
        pose = np.array(truth) + rng.normal(0.0, 0.01, 3)
        turn = complex(math.cos(pose[2]), math.sin(pose[2]))
        near = through = 0
        for x, y, ux, uy, r in w:
            told = naive_polygon.predict(
                (complex(x, y) - complex(pose[0], pose[1])) / turn, complex(ux, uy) / turn, r, corners, closed=True,
                may=MAY, must=IN, half=HALF,
            )  # fmt: skip
            if told.miss is not None and abs(told.miss) < P.gate:
                near += 1
            elif told.must and told.strong is not None and r > told.strong:
                through += 1
        stats = np.zeros(12)
        total = score(w, pose, stats)
        assert total == stats[LLR]
        assert (stats[NEAR], stats[THROUGHS]) == (near, through)
        assert stats[SURE] <= stats[HITS] <= stats[NEAR]
        seen += (stats[NEAR], stats[THROUGHS], stats[SURE])
    assert seen.min() > 150


def test_the_truth_is_worth_more_than_a_pose_beside_it() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        truth = np.array([rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-math.pi, math.pi)])
        w = heard(rng, (truth[0], truth[1], truth[2]), 60, 0.0)
        direction = rng.uniform(-math.pi, math.pi)
        beside = truth + 0.1 * np.array([math.cos(direction), math.sin(direction), 0.0])
        assert score(w, truth, np.zeros(12)) > score(w, beside, np.zeros(12))


def test_a_search_never_loses_and_finds_the_pose() -> None:
    """From 3 cm and 3° beside it, to a third of the ranges' step; the rounding leaves a plateau of that width."""
    rng = np.random.default_rng(4)
    offs = []
    for _ in range(150):
        truth = np.array([rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-math.pi, math.pi)])
        w = heard(rng, (truth[0], truth[1], truth[2]), 80, 0.0)
        pose = truth + np.array([*rng.normal(0.0, 0.03, 2), rng.normal(0.0, 0.05)])
        before = score(w, pose, np.zeros(12))
        after = search(
            w, len(w), pose, 0.05, 0.5, 40, BOX, 4, CLOSED, P.cos_opt, P.cos_in, P.cos_half, math.sin(HALF),
            P.gate, P.miss, P.short, P.levels[9], P.per_metre, P.table, P.inv_step, np.zeros(12), np.zeros(12),
        )  # fmt: skip
        assert after >= before
        assert after == pytest.approx(score(w, pose, np.zeros(12)), abs=1e-9)
        offs.append((math.hypot(pose[0] - truth[0], pose[1] - truth[1]), abs(pose[2] - truth[2])))
    assert np.median([d for d, _ in offs]) < 0.01
    assert np.quantile([d for d, _ in offs], 0.9) < 0.03
    assert np.median([a for _, a in offs]) < math.radians(2.0)
