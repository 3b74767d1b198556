"""Contact of polygons against its oracle, and the search for a pose on readings whose pose is known."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from config.load import load_model, load_settings
from perception.bayes.kernel_settings import make_settings
from perception.bayes.likelihood import loglik
from perception.bayes.object_report import polygon_covariance
from perception.bayes.polygon_job import COV, HEARD, HISS, LAID, MIDDLE, ear_of, sides_of
from perception.bayes.polygon_likelihood import (
    BEST,
    LEFT,
    NOTHING,
    SURE,
    THETA,
    X,
    Y,
    begin_search,
    predict,
    score_poly,
    search,
)
from perception.bayes.polygon_posterior import (
    ATTEMPTS,
    CORRELATED,
    CUT_OFF,
    LATTICE,
    PITCH,
    THINNEST,
    begin_lattice,
    centre_moments,
    lattice_on,
    leave_frame,
    lower_root,
    weigh_lattice,
)
from perception.bayes.range_fit import FAR, HITS, LLR, NEAR, THROUGHS, level_of
from perception.bayes.state import NPF, PTT, PXX, State, make_state
from perception.kernel import Floats, Ints
from tests import naive_polygon
from tests.naive_polygon import Rule

SETTINGS = load_settings("hallway", models=("semicircle", "box"))
P = make_settings(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.bayes)
MAY, IN, HALF = math.acos(P.cos_opt), math.acos(P.cos_in), P.half_angle
NOISE_M = 0.03 * 0.3048
BOXES = 300
CLOSED = True
BOX = np.array(load_model("box").vertices_m)
EAR = ear_of(P)
FACES = P.faces[0, : sides_of(P, 0)]
LEVEL = 9
"""The noise that is believed: σ = 0.03 ft, 0.5 %."""


def faces_between(outline: Floats, closed: bool) -> Floats:
    along = np.roll(outline, -1, axis=0) - outline
    length = np.hypot(along[:, 0], along[:, 1])
    faces: Floats = np.column_stack([outline, along / length[:, None], length])
    return faces if closed else np.ascontiguousarray(faces[:-1])


def random_outline(rng: np.random.Generator) -> Floats:
    """A star-shaped outline, counterclockwise, 0.1 to 0.6 m about the origin."""
    n = int(rng.integers(3, 9))
    angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, n)) + np.arange(n) * 1e-3
    outline: Floats = rng.uniform(0.1, 0.6, n)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return outline


def rules(sensor: complex, axis: complex, pose: Floats, outline: Floats, closed: bool) -> tuple[Rule, Rule]:
    turn = complex(math.cos(pose[2]), math.sin(pose[2]))
    return naive_polygon.predict(
        (sensor - complex(pose[0], pose[1])) / turn, axis / turn, [complex(x, y) for x, y in outline], closed=closed,
        may=MAY, must=IN, half=HALF,
    )  # fmt: skip


def heard(rng: np.random.Generator, pose: Floats, n: int, noise_m: float, rule: int = 0) -> Floats:
    """Readings of a box from all sides as a mirror (0) or a cone (1) sends them back, rounded; else far silence."""
    rows: list[tuple[float, ...]] = []
    while len(rows) < n:
        bearing, away = rng.uniform(-math.pi, math.pi), rng.uniform(0.8, 2.0)
        sensor = complex(pose[0], pose[1]) + away * complex(math.cos(bearing), math.sin(bearing))
        axis_angle = bearing + math.pi + rng.uniform(-0.5, 0.5)
        axis = complex(math.cos(axis_angle), math.sin(axis_angle))
        told = rules(sensor, axis, pose, BOX, closed=True)[rule]
        r = FAR * 2.0
        if told.expected is not None and told.price == 0.0:
            r = round((told.expected + rng.normal(0.0, noise_m)) / 0.03048) * 0.03048
        rows.append((sensor.real, sensor.imag, axis.real, axis.imag, r))
    return np.array(rows)


def score(w: Floats, pose: Floats, stats: Floats, level: Ints = P.levels[LEVEL], every: int = 1) -> float:
    return score_poly(
        w, len(w), every, pose[0], pose[1], pose[2], FACES, CLOSED, EAR, level, P.table, P.inv_step, stats
    )  # fmt: skip


def test_a_prediction_equals_its_oracle() -> None:
    rng = np.random.default_rng(1)
    seen = np.zeros(5)
    for _ in range(6_000):
        outline = random_outline(rng)
        closed = bool(rng.integers(2))
        sensor = complex(*rng.uniform(-2.0, 2.0, 2))
        axis_angle = math.atan2(-sensor.imag, -sensor.real) + rng.uniform(-0.6, 0.6)
        axis = complex(math.cos(axis_angle), math.sin(axis_angle))
        mirror, cone = rules(sensor, axis, np.zeros(3), outline, closed)
        at, must, price, at_cone, must_cone = predict(
            sensor.real, sensor.imag, axis.real, axis.imag, faces_between(outline, closed), closed, EAR
        )  # fmt: skip
        for expected, told, told_must in ((mirror, at, must), (cone, at_cone, must_cone)):
            assert told == pytest.approx(NOTHING if expected.expected is None else expected.expected, abs=1e-12)
            assert told_must == expected.must
        assert price == pytest.approx(mirror.price, abs=1e-9)
        differ = cone.expected is not None and cone.expected != mirror.expected
        seen += (mirror.must, cone.must and not mirror.must, mirror.price > 0.0, differ, cone.expected is None)
    assert seen.min() > 300


def test_a_score_equals_its_oracle() -> None:
    """On readings of boxes, some of them late, early or lost, at poses a little off."""
    rng = np.random.default_rng(2)
    seen = np.zeros(4)
    for k in range(400):
        truth = np.array([rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-math.pi, math.pi)])
        w = heard(rng, truth, 30, 0.01, k % 2)
        w[rng.uniform(size=30) < 0.3, 4] *= rng.uniform(0.9, 1.8)
        pose = truth + rng.normal(0.0, 0.01, 3)
        readings = []
        for x, y, ux, uy, r in w:
            mirror, cone = rules(complex(x, y), complex(ux, uy), pose, BOX, closed=True)
            level = level_of(P.levels[LEVEL], r, P.per_metre)
            evidence = [
                0.0 if told.expected is None else loglik(P.table, P.inv_step, level, r - told.expected)
                for told in (mirror, cone)
            ]
            readings.append((r, (mirror, cone), (evidence[0], evidence[1])))
        expected, sums = naive_polygon.score(readings, P.gate, P.miss, P.short)
        stats = np.zeros(12)
        assert score(w, pose, stats) == pytest.approx(expected, abs=1e-9)
        assert stats[LLR] == pytest.approx(expected, abs=1e-9)
        likelier = max(sums, key=lambda s: s["llr"])
        counts = (likelier["hits"], likelier["throughs"], likelier["near"], likelier["sure"])
        assert tuple(stats[[HITS, THROUGHS, NEAR, SURE]]) == counts
        seen += counts
    assert seen.min() > 150


def test_the_truth_is_worth_more_than_a_pose_beside_it() -> None:
    rng = np.random.default_rng(3)
    for k in range(200):
        truth = np.array([rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-math.pi, math.pi)])
        w = heard(rng, truth, 60, 0.0, k % 2)
        if np.count_nonzero(w[:, 4] < FAR) < 5:
            continue
        direction = rng.uniform(-math.pi, math.pi)
        beside = truth + 0.1 * np.array([math.cos(direction), math.sin(direction), 0.0])
        assert score(w, truth, np.zeros(12)) > score(w, beside, np.zeros(12))


@pytest.mark.compiled
def test_a_search_never_loses_and_finds_the_pose_however_often_it_is_interrupted() -> None:
    """From 3 cm and 3° beside it, to a third of the ranges' step; the rounding leaves a plateau of that width."""
    rng = np.random.default_rng(4)
    offs = []
    for _ in range(150):
        truth = np.array([rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-math.pi, math.pi)])
        w = heard(rng, truth, 80, 0.0)
        start = truth + np.array([*rng.normal(0.0, 0.03, 2), rng.normal(0.0, 0.05)])
        found = []
        for allowed in (1_000, int(rng.integers(1, 10))):
            f, z, stats, weighed, calls = np.zeros(5), np.zeros(3, np.int64), np.zeros(12), 0, 0
            begin_search(f, z, start[0], start[1], start[2], 0.05, 40)
            while z[LEFT] > 0:
                once = search(
                    w, len(w), 1, f, z, allowed, FACES, CLOSED, EAR, P.levels[LEVEL], P.table, P.inv_step, stats
                )  # fmt: skip
                assert 0 < once <= allowed
                weighed, calls = weighed + once, calls + 1
            assert weighed <= 1 + 6 * 40
            assert calls == math.ceil(weighed / allowed)
            found.append((*f, weighed))
        assert found[0] == found[1]
        pose, after = np.array([f[X], f[Y], f[THETA]]), f[BEST]
        assert after >= score(w, start, np.zeros(12))
        assert after == pytest.approx(score(w, pose, np.zeros(12)), abs=1e-9)
        offs.append((math.hypot(pose[0] - truth[0], pose[1] - truth[1]), abs(pose[2] - truth[2])))
    assert np.median([d for d, _ in offs]) < 0.01
    assert np.quantile([d for d, _ in offs], 0.9) < 0.03
    assert np.median([a for _, a in offs]) < math.radians(2.0)


def test_every_other_reading_is_every_other_reading() -> None:
    rng = np.random.default_rng(8)
    truth = np.array([0.3, -0.2, 0.4])
    w = heard(rng, truth, 41, 0.01)
    for every in (1, 2, 3, 50):
        told, wanted = np.zeros(12), np.zeros(12)
        assert score(w, truth, told, every=every) == score(np.ascontiguousarray(w[::every]), truth, wanted)
        assert told.tolist() == wanted.tolist()


def test_the_moments_of_a_lattice_equal_numpys() -> None:
    rng = np.random.default_rng(5)
    ball = [z for z in itertools.product(range(-3, 4), repeat=3) if z[0] ** 2 + z[1] ** 2 + z[2] ** 2 <= 6]
    assert LATTICE.tolist() == [list(z) for z in ball]
    normal = np.exp(-0.5 * PITCH**2 * np.sum(np.square(ball), axis=1))
    assert pytest.approx(PITCH**2 * np.average(LATTICE[:, 0] ** 2, weights=normal)) == CUT_OFF
    for _ in range(10):
        truth = np.array([rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-math.pi, math.pi)])
        w = heard(rng, truth, 40, 0.01)
        pose = truth + rng.normal(0.0, 0.002, 3)
        lower = np.tril(rng.normal(0.0, 0.001, (3, 3)) + np.diag([0.004, 0.004, 0.01]))
        covariance = lower @ lower.T
        cov = covariance[np.tril_indices(3)]
        root, sums = np.zeros(6), np.zeros(10)
        lower_root(cov, root)
        assert root == pytest.approx(PITCH * np.linalg.cholesky(covariance)[np.tril_indices(3)], abs=1e-12)
        level = P.levels[LEVEL]
        top = score(w, pose, np.zeros(12), level)
        half = int(rng.integers(0, len(ball)))
        for begin, end in ((0, half), (half, len(ball))):
            weigh_lattice(
                w, len(w), FACES, CLOSED, EAR, level, P.table, P.inv_step, np.zeros(12), pose, root, top, begin, end,
                sums,
            )  # fmt: skip
        centre_moments(sums)
        moments = sums[1:]
        lower = np.zeros((3, 3))
        lower[np.tril_indices(3)] = root
        points = np.array(ball, dtype=np.float64)
        weights = np.exp([min(40.0, score(w, pose + lower @ z, np.zeros(12), level) - top) for z in points])
        mean = np.average(points, axis=0, weights=weights)
        spread = np.cov(points.T, aweights=weights, ddof=0)
        assert moments == pytest.approx([*mean, *spread[np.tril_indices(3)]], abs=1e-9)
        before = pose.copy()
        leave_frame(pose, root, moments, cov)
        assert pose == pytest.approx(before + lower @ mean, abs=1e-12)
        shrunk = CORRELATED * spread + (1.0 - CORRELATED) * np.diag(np.diag(spread))
        np.fill_diagonal(shrunk, np.maximum(np.diag(spread), THINNEST))
        assert cov == pytest.approx((lower @ shrunk @ lower.T / CUT_OFF)[np.tril_indices(3)], abs=1e-15)


def spread_of(state: State, w: Floats, pose: Floats, left: int) -> tuple[Floats, Floats]:
    """Mean and covariance, worked out `left` at a time."""
    state.pw[: len(w)] = w
    state.job[HEARD] = len(w)
    begin_lattice(state, P, 0, pose, np.zeros(6))
    while state.job[LAID] < ATTEMPTS:
        lattice_on(state, P, 0, left)
    track = np.zeros(NPF)
    track[PXX : PTT + 1] = state.work[COV : COV + 6]
    return state.work[MIDDLE : MIDDLE + 3].copy(), polygon_covariance(track)


@pytest.mark.compiled
@pytest.mark.parametrize("rule", [0, 1], ids=["mirror", "cone"])
def test_the_covariance_is_honest(rule: int) -> None:
    """95 % of true poses lie in the 95 % ellipse, of the place and of the whole pose, on noisy boxes.

    Or a little more: what is reported allows for neighbours, and here are none.
    """
    rng = np.random.default_rng(6)
    state = make_state(24, P)
    state.job[HISS] = P.noises.tolist().index([NOISE_M, 0.0])
    level = P.levels[state.job[HISS]]
    place, whole = [], []
    for _ in range(BOXES):
        truth = np.array([rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-math.pi, math.pi)])
        w = heard(rng, truth, 120, NOISE_M, rule)
        w[rng.uniform(size=120) < 0.05, 4] = 2.0 * FAR
        stray = rng.uniform(size=120) < 0.01
        w[stray, 4] = rng.uniform(0.2, 4.5, int(stray.sum()))
        pose = truth + np.array([*rng.normal(0.0, 0.01, 2), rng.normal(0.0, 0.02)])
        f, z = np.zeros(5), np.zeros(3, np.int64)
        begin_search(f, z, pose[0], pose[1], pose[2], 0.03, 20)
        search(w, 120, 1, f, z, 1_000, FACES, CLOSED, EAR, level, P.table, P.inv_step, np.zeros(12))
        mean, c = spread_of(state, w, f[:3], 1_000_000)
        assert np.linalg.eigvalsh(c).min() > 0.0
        e = mean - truth
        place.append(e[:2] @ np.linalg.solve(c[:2, :2], e[:2]) < 5.991)
        whole.append(e @ np.linalg.solve(c, e) < 7.815)
    assert 0.92 <= np.mean(place) <= 0.99
    assert 0.92 <= np.mean(whole) <= 0.99


def test_a_lattice_is_the_same_however_often_it_is_interrupted() -> None:
    rng = np.random.default_rng(7)
    state = make_state(24, P)
    state.job[HISS] = LEVEL
    for left in (1, 3_000, 20_000):
        w = heard(rng, np.zeros(3), 60, NOISE_M)
        whole, interrupted = (spread_of(state, w, np.zeros(3), many) for many in (10_000_000, left))
        assert np.array_equal(whole[0], interrupted[0])
        assert np.array_equal(whole[1], interrupted[1])
